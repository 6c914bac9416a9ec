// Binds command-line flags and config-file keys to struct fields: default, help text, parsing and the
// written-back value all come from one line per option.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <variant>
#include <vector>

namespace pipeline {

class Options {
 public:
  using Field = std::variant<bool*, int*, std::uint64_t*, double*, std::string*, std::filesystem::path*>;

  // program: "pipeline train"; description: what --help says first.
  Options(std::string program, std::string description);
  ~Options();

  // name without dashes ("image-size"); the field holds the default. affects_result = false keeps the option
  // out of the stage cache's key (threads, output folder).
  void Add(const std::string& name, Field field, const std::string& help, bool affects_result = true);
  void AddPositional(const std::string& name, Field field, const std::string& help, bool required);

  // Parses `--name value`, `--name=value`, bare `--name` and `--no-name` for bool, and `--config FILE` (a
  // JSON object with the same names; flags win). `--` ends the options. Unknown names throw kUsage and name
  // the nearest one. Returns false when --help was asked for and printed.
  bool Parse(int argc, const char* const* argv);

  // After Parse: lets `assign` write the values of a preset into the bound fields, and reads flags and file,
  // which win, again.
  void ApplyPreset(int argc, const char* const* argv, const std::function<void()>& assign);

  // Marks a value as chosen by measurement rather than by default, file or flag.
  void SetMeasured(const std::string& name);
  bool IsSetByUser(const std::string& name) const;
  // Names of the flags for which that holds, in the order in which they were added.
  std::vector<std::string> NamesSetByUser() const;
  // The value as one would write it after the flag.
  std::string ValueText(const std::string& name) const;

  // {"name": {"value": ..., "origin": "default" | "preset" | "file" | "flag" | "measured"}, ...}
  std::string ResolvedJson() const;
  // Canonical text of all values that affect the result.
  std::string KeyText() const;

 private:
  struct Option;
  Option* Find(const std::string& name) const;
  // Returns how many further arguments the flag consumed.
  int ParseFlag(const std::string& flag, const char* next, std::filesystem::path* config);
  void ReadConfig(const std::filesystem::path& path);
  void PrintHelp() const;

  std::string program_, description_;
  std::vector<std::unique_ptr<Option>> options_;
};

// Seconds from "90", "90s", "1.5m" or "2h". Throws kUsage naming the option.
double ParseDuration(const std::string& option_name, const std::string& text);

// Decibels from "30" or "30dB". Throws kUsage naming the option.
double ParseDecibels(const std::string& option_name, const std::string& text);

// The candidate with the smallest edit distance to `name`; empty when there is none.
std::string NearestName(const std::string& name, const std::vector<std::string>& candidates);

}  // namespace pipeline
