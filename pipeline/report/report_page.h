// The report as one HTML file: pictures, film, style and script are inside it, and it loads nothing from
// elsewhere.
#pragma once

#include <string>

#include "pipeline/report/report_data.h"

namespace pipeline {

// Reads the film and the strips named in `data`.
std::string ReportPage(const ReportData& data);

// The page's style sheet and script, in files of their own.
extern const char kReportStyle[];
extern const char kReportScript[];

}  // namespace pipeline
