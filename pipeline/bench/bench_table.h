// The long table of a benchmark: one measured value per line, with everything needed to tell the lines apart.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace pipeline {

struct BenchValue {
  std::string what;        // who did it on what: "ours fox", "COLMAP default fox"
  std::string parameters;  // "features=2048 size=1600 matching=likely"
  std::string metric, unit;
  double value = 0;  // "nan" and "inf" are written as such: failures stay in
};

// The fields of one line of CSV (RFC 4180): quoted where they hold a comma, a quote or a line break.
std::string CsvLine(const std::vector<std::string>& fields);

// Shortest decimal text that reads back as the same value.
std::string CsvNumber(double value);

// "machine" and "commit" of every line: processor and cores, and the revision this program was built from.
std::string BenchMachine();
std::string BenchCommit();

// The header of the long table.
inline constexpr const char* kBenchTableHeader = "machine,commit,what,parameters,metric,unit,value";
// Benchmarks have tables of the same name. Throws kUsage when `path` exists and begins with another header.
void CheckTableIsOurs(const std::filesystem::path& path, const std::string& header);

// Under kBenchTableHeader.
void WriteBenchTable(const std::filesystem::path& path, const std::vector<BenchValue>& values);

// "a,b,c" without blanks around the parts; empty parts are dropped.
std::vector<std::string> SplitList(const std::string& text);
// The same as integers >= minimum. Throws kUsage naming the option.
std::vector<int> SplitIntegers(const std::string& option_name, const std::string& text, int minimum);

}  // namespace pipeline
