// The report as one HTML file: pictures, film, style and script are inside it, and it loads nothing from
// elsewhere.
#pragma once

#include <string>

#include "pipeline/report/report_data.h"

namespace pipeline {

// Reads the films and the pictures named in `data`.
std::string ReportPage(const ReportData& data);

// report.css and report.js, which the build embeds.
extern const char kReportStyle[];
extern const char kReportScript[];

}  // namespace pipeline
