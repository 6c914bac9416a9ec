#include "pipeline/stage/options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>

#include "io/base/atomic_file.h"
#include "io/base/error.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxConfigBytes = 1 << 20;  // a configuration is a page of text

std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row.back();
}

template <typename T>
void ParseNumber(const std::string& name, const std::string& text, T* value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *value);
  if (error != std::errc() || end != text.data() + text.size() ||
      !std::isfinite(static_cast<double>(*value))) {
    throw Error(ExitCode::kUsage, "--" + name + ": '" + text + "' is not a number in range");
  }
}

std::string Dump(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

struct Options::Option {
  std::string name, help;
  Field field;
  bool affects_result, positional, required;
  std::string origin = "default";

  void Assign(const std::string& text) const {
    if (auto* b = std::get_if<bool*>(&field)) {
      if (text != "true" && text != "false")
        throw Error(ExitCode::kUsage, "--" + name + ": '" + text + "' is neither true nor false");
      **b = text == "true";
    } else if (auto* i = std::get_if<int*>(&field)) {
      ParseNumber(name, text, *i);
    } else if (auto* u = std::get_if<std::uint64_t*>(&field)) {
      ParseNumber(name, text, *u);
    } else if (auto* d = std::get_if<double*>(&field)) {
      ParseNumber(name, text, *d);
    } else if (auto* s = std::get_if<std::string*>(&field)) {
      **s = text;
    } else {
      *std::get<std::filesystem::path*>(field) = text;
    }
  }

  // JSON types are taken at their word: "5" is no number and 5 is no file name.
  void AssignJson(const std::filesystem::path& file, const Json& value) const {
    const bool is_text =
        std::holds_alternative<std::string*>(field) || std::holds_alternative<std::filesystem::path*>(field);
    const bool fits = is_text                                ? value.is_string()
                      : std::holds_alternative<bool*>(field) ? value.is_boolean()
                                                             : value.is_number();
    if (!fits) {
      throw Error(ExitCode::kUsage,
                  file.string() + ": \"" + name + "\": " + Dump(value) + " has the wrong type",
                  std::string("Write ") + (is_text ? "a string" : "a number, or true or false for a switch"));
    }
    Assign(is_text ? value.get<std::string>() : value.dump());
  }

  Json Value() const {
    return std::visit(
        [](auto* value) -> Json {
          if constexpr (std::is_same_v<decltype(value), std::filesystem::path*>) {
            return value->string();
          } else {
            return *value;
          }
        },
        field);
  }
};

Options::Options(std::string program, std::string description)
    : program_(std::move(program)), description_(std::move(description)) {}

Options::~Options() = default;

void Options::Add(const std::string& name, Field field, const std::string& help, bool affects_result) {
  options_.push_back(std::make_unique<Option>(Option{name, help, field, affects_result, false, false}));
}

void Options::AddPositional(const std::string& name, Field field, const std::string& help, bool required) {
  options_.push_back(std::make_unique<Option>(Option{name, help, field, false, true, required}));
}

Options::Option* Options::Find(const std::string& name) const {
  std::vector<std::string> names;
  for (const auto& option : options_) {
    if (option->positional) continue;
    if (option->name == name) return option.get();
    names.push_back(option->name);
  }
  const std::string nearest = NearestName(name, names);
  throw Error(ExitCode::kUsage,
              program_ + ": unknown option '" + name + "'",
              nearest.empty() ? "See --help" : "Did you mean --" + nearest + "? See --help");
}

bool Options::Parse(int argc, const char* const* argv) {
  std::vector<Option*> positional;
  for (const auto& option : options_) {
    if (option->positional) positional.push_back(option.get());
  }
  std::size_t n_positional = 0;
  std::filesystem::path config;
  bool options_ended = false;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (options_ended || argument.size() < 2 || argument[0] != '-') {
      if (n_positional == positional.size())
        throw Error(ExitCode::kUsage, program_ + ": unexpected argument '" + argument + "'", "See --help");
      positional[n_positional]->Assign(argument);
      positional[n_positional++]->origin = "flag";
    } else if (argument == "--help" || argument == "-h") {
      PrintHelp();
      return false;
    } else if (argument == "--") {
      options_ended = true;
    } else if (argument[1] != '-') {
      throw Error(ExitCode::kUsage,
                  program_ + ": unknown option '" + argument + "'",
                  "Options begin with two dashes; write -- before a name that begins with one");
    } else {
      i += ParseFlag(argument.substr(2), i + 1 < argc ? argv[i + 1] : nullptr, &config);
    }
  }
  if (!config.empty()) ReadConfig(config);
  if (n_positional < positional.size() && positional[n_positional]->required) {
    throw Error(
        ExitCode::kUsage, program_ + ": " + positional[n_positional]->name + " is missing", "See --help");
  }
  return true;
}

int Options::ParseFlag(const std::string& flag, const char* next, std::filesystem::path* config) {
  const std::size_t equals = flag.find('=');
  const bool has_value = equals != std::string::npos;
  std::string name = flag.substr(0, equals);
  const auto value = [&]() -> std::string {
    if (has_value) return flag.substr(equals + 1);
    if (!next) throw Error(ExitCode::kUsage, program_ + ": --" + name + " needs a value", "See --help");
    return next;
  };
  if (name == "config") {
    *config = value();
    return !has_value;
  }
  const bool exists =
      std::any_of(options_.begin(), options_.end(), [&](const auto& option) { return option->name == name; });
  const bool negated = !exists && name.rfind("no-", 0) == 0;
  if (negated) name = name.substr(3);
  Option* option = Find(name);
  option->origin = "flag";
  if (!std::holds_alternative<bool*>(option->field)) {
    if (negated) throw Error(ExitCode::kUsage, program_ + ": --no-" + name + ": --" + name + " is no switch");
    option->Assign(value());
    return !has_value;
  }
  if (negated && has_value) throw Error(ExitCode::kUsage, program_ + ": --no-" + name + " takes no value");
  option->Assign(has_value ? value() : negated ? "false" : "true");
  return 0;
}

void Options::ReadConfig(const std::filesystem::path& path) {
  std::set<std::string> keys;
  const auto check_keys = [&](int depth, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::key && depth == 1 && !keys.insert(parsed.get<std::string>()).second)
      throw Error(ExitCode::kUsage, path.string() + ": \"" + parsed.get<std::string>() + "\" is given twice");
    return true;
  };
  Json config;
  try {
    config = Json::parse(io::ReadFile(path, kMaxConfigBytes), check_keys);
  } catch (const Json::exception& error) {
    throw Error(ExitCode::kUsage, path.string() + ": " + error.what());
  }
  if (!config.is_object()) throw Error(ExitCode::kUsage, path.string() + ": is not a JSON object");
  for (const auto& [key, value] : config.items()) {
    Option* option = Find(key);
    if (option->origin == "flag") continue;
    option->AssignJson(path, value);
    option->origin = "file";
  }
}

void Options::ApplyPreset(int argc, const char* const* argv, const std::function<void()>& assign) {
  std::vector<Json> before;
  for (const auto& option : options_) before.push_back(option->Value());
  assign();
  for (std::size_t i = 0; i < options_.size(); ++i) {
    if (options_[i]->origin == "default" && options_[i]->Value() != before[i]) options_[i]->origin = "preset";
  }
  Parse(argc, argv);
}

void Options::SetMeasured(const std::string& name) { Find(name)->origin = "measured"; }

bool Options::IsSetByUser(const std::string& name) const {
  const std::string& origin = Find(name)->origin;
  return origin == "flag" || origin == "file";
}

std::vector<std::string> Options::NamesSetByUser() const {
  std::vector<std::string> names;
  for (const auto& option : options_) {
    if (!option->positional && IsSetByUser(option->name)) names.push_back(option->name);
  }
  return names;
}

std::string Options::ValueText(const std::string& name) const {
  const Option& option = *Find(name);
  const Json value = option.Value();
  if (const auto* d = std::get_if<double*>(&option.field)) {
    char text[32];  // the shortest that reads back the same: at most 24 characters
    return std::string(text, std::to_chars(text, text + sizeof text, **d).ptr);
  }
  return value.is_string() ? value.get<std::string>() : value.dump();
}

std::string Options::ResolvedJson() const {
  Json json = Json::object();
  for (const auto& option : options_)
    json[option->name] = {{"value", option->Value()}, {"origin", option->origin}};
  return Dump(json);
}

std::string Options::KeyText() const {
  Json json = Json::object();
  for (const auto& option : options_) {
    if (option->affects_result) json[option->name] = option->Value();
  }
  return Dump(json);
}

void Options::PrintHelp() const {
  std::string usage = "usage: " + program_;
  for (const auto& option : options_) {
    if (option->positional) usage += option->required ? " " + option->name : " [" + option->name + "]";
  }
  std::printf("%s [options]\n\n%s\n\n", usage.c_str(), description_.c_str());
  for (const auto& option : options_) {
    const std::string left = option->positional ? option->name : "--" + option->name;
    const std::string value = Dump(option->Value());
    const bool show = !option->positional && value != "\"\"";
    std::printf(
        "  %-22s %s%s\n", left.c_str(), option->help.c_str(), show ? (" [" + value + "]").c_str() : "");
  }
  std::printf("  %-22s %s\n", "--config", "JSON file with option values; flags win");
}

double ParseDuration(const std::string& option_name, const std::string& text) {
  double number = 0;
  const char* const last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, number);
  const std::string unit(end, last);
  const double unit_s = unit.empty() || unit == "s" ? 1 : unit == "m" ? 60 : unit == "h" ? 3600 : 0;
  if (error != std::errc() || unit_s == 0 || !std::isfinite(number) || number < 0) {
    throw Error(ExitCode::kUsage,
                "--" + option_name + ": '" + text + "' is not a duration",
                "Write for example 90s, 5m or 1.5h");
  }
  return number * unit_s;
}

double ParseDecibels(const std::string& option_name, const std::string& text) {
  double number = 0;
  const char* const last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, number);
  const std::string unit(end, last);
  if (error != std::errc() || (!unit.empty() && unit != "dB") || !(number > 0 && number < 100)) {
    throw Error(ExitCode::kUsage,
                "--" + option_name + ": '" + text + "' is not a number of decibels",
                "Write for example 30dB");
  }
  return number;
}

std::string NearestName(const std::string& name, const std::vector<std::string>& candidates) {
  const auto nearest =
      std::min_element(candidates.begin(), candidates.end(), [&](const auto& a, const auto& b) {
        return EditDistance(name, a) < EditDistance(name, b);
      });
  return nearest == candidates.end() ? "" : *nearest;
}

}  // namespace pipeline
