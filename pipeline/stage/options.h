// Binds command-line flags and config-file keys to struct fields: default, help text, range, parsing and the
// written-back value all come from one line per option. CLI11 reads the command line and lays out --help.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <variant>
#include <vector>
#include "io/base/json.h"

namespace CLI {
class App;
}

namespace pipeline {

// What a value must satisfy. Parse refuses others with kUsage naming the option, the value and the rule.
struct OptionRule {
  double min = -std::numeric_limits<double>::infinity(), max = std::numeric_limits<double>::infinity();
  double above = -std::numeric_limits<double>::infinity(), below = std::numeric_limits<double>::infinity();
  std::vector<std::string> choices;  // the only values; empty: any
  // Throws kUsage, for values that have a form of their own.
  std::function<void(const std::string& option_name, const std::string& text)> check;
  bool affects_result = true;  // false: not in the stage cache's key (threads, output folder)
  std::string required;        // what a missing value is called, such as DIR; empty: it may be missing
};

class Options {
 public:
  using Field = std::variant<bool*, int*, std::uint64_t*, double*, std::string*, std::filesystem::path*>;

  // program: "pipeline train"; description: what --help says first.
  Options(const std::string& program, const std::string& description);
  ~Options();

  // name without dashes ("image-size"); the field holds the default.
  void Add(const std::string& name, Field field, const std::string& help, const OptionRule& rule = {});
  void AddPositional(const std::string& name, Field field, const std::string& help, bool required);
  // Takes over an option of `other` under the name `name`: its field, rule and help with `note` in brackets.
  void AddFrom(const Options& other,
               const std::string& other_name,
               const std::string& name,
               const std::string& note);

  // Parses `--name value`, `--name=value`, bare `--name` and `--no-name` for bool, and `--config FILE` (a
  // JSON object with the same names; flags win). `--` ends the options. Of a repeated flag the last counts.
  // Unknown names throw kUsage and name the nearest one; so do empty values. Returns false when --help was
  // asked for and printed.
  bool Parse(int argc, const char* const* argv);

  // After Parse: lets `assign` write the values of a preset into the bound fields, and reads flags and file,
  // which win, again.
  void ApplyPreset(int argc, const char* const* argv, const std::function<void()>& assign);

  bool IsSetByUser(const std::string& name) const;
  // Names of the flags for which that holds, in the order in which they were added.
  std::vector<std::string> NamesSetByUser() const;
  // The value as one would write it after the flag.
  std::string ValueText(const std::string& name) const;

  // {"name": {"value": ..., "origin": "default" | "preset" | "file" | "flag"}, ...}
  io::Json ResolvedJson() const;
  // Canonical text of all values that affect the result.
  std::string KeyText() const;

 private:
  struct Option;
  Option& Find(const std::string& name) const;
  [[noreturn]] void RefuseArgument(const std::string& argument) const;
  void ReadConfig(const std::filesystem::path& path);

  std::unique_ptr<CLI::App> app_;
  std::vector<std::unique_ptr<Option>> options_;
};

// Seconds from "90", "90s", "1.5m" or "2h": more than 0, at most 30 days. Throws kUsage naming the option.
double ParseDuration(const std::string& option_name, const std::string& text);

// Decibels from "30" or "30dB". Throws kUsage naming the option.
double ParseDecibels(const std::string& option_name, const std::string& text);

// The candidate with the smallest edit distance to `name`; empty when there is none.
std::string NearestName(const std::string& name, const std::vector<std::string>& candidates);

}  // namespace pipeline
