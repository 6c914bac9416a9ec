#include "pipeline/bench/bench_table.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/quoting.h"
#include "pipeline/machine/machine.h"
#include "pipeline/stage/versions.h"

namespace pipeline {

std::string CsvLine(const std::vector<std::string>& fields) {
  std::string line;
  for (const std::string& field : fields) {
    if (&field != &fields.front()) line += ',';
    line += io::CsvField(field);
  }
  return line + "\n";
}

std::string CsvNumber(double value) {
  if (std::isnan(value)) return "nan";  // without the sign, which means nothing
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  return {text, end};
}

std::string BenchMachine() {
  const Machine machine = DescribeMachine();
  return fmt::format("{}, {} cores", machine.cpu, machine.cores);
}

std::string BenchCommit() { return VersionsJson()["commit"].get<std::string>(); }

void CheckTableIsOurs(const std::filesystem::path& path, const std::string& header) {
  std::string first;
  if (!std::getline(std::ifstream(path), first) || first == header) return;
  throw io::Error(io::ExitCode::kUsage,
                  path.string() + ": was written by another benchmark",
                  "Choose another --out, or remove the file");
}

void WriteBenchTable(const std::filesystem::path& path, const std::vector<BenchValue>& values) {
  const std::string machine = BenchMachine(), commit = BenchCommit();
  std::string text = std::string(kBenchTableHeader) + "\n";
  for (const BenchValue& v : values)
    text += CsvLine({machine, commit, v.what, v.parameters, v.metric, v.unit, CsvNumber(v.value)});
  io::WriteFileAtomically(path, text);
}

std::vector<std::string> SplitList(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, ',');) {
    const std::size_t first = part.find_first_not_of(' '), last = part.find_last_not_of(' ');
    if (first != std::string::npos) parts.push_back(part.substr(first, last - first + 1));
  }
  return parts;
}

std::vector<int> SplitIntegers(const std::string& option_name, const std::string& text, int minimum) {
  std::vector<int> values;
  for (const std::string& part : SplitList(text)) {
    int value = 0;
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
    if (error != std::errc() || end != part.data() + part.size() || value < minimum) {
      throw io::Error(io::ExitCode::kUsage,
                      fmt::format("--{}: '{}' is not a number >= {}", option_name, part, minimum),
                      "Separate numbers by commas");
    }
    values.push_back(value);
  }
  return values;
}

}  // namespace pipeline
