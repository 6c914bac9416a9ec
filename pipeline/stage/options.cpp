#include "pipeline/stage/options.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/json.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
using io::Json;

constexpr std::size_t kMaxConfigBytes = 1 << 20;  // a configuration is a page of text
constexpr double kMaxDuration_s = 30 * 24 * 3600;

[[noreturn]] void Refuse(const std::string& what, const std::string& remedy = "See --help") {
  throw Error(ExitCode::kUsage, what, remedy);
}

// Letters inserted, left out, replaced, or swapped with their neighbour (optimal string alignment).
std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    before = std::exchange(last, row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before[j - 2] + 1);
    }
  }
  return row.back();
}

// "at least 1, below 240"; empty without bounds.
std::string RangeText(const OptionRule& rule) {
  std::string text;
  const auto add = [&](const char* words, double bound) {
    if (std::isfinite(bound)) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", words, bound);
  };
  add("at least", rule.min), add("above", rule.above), add("at most", rule.max), add("below", rule.below);
  return text;
}

// CLI11's own conversions read 010 as eight and -1 as a large seed, and round doubles twice.
template <typename T>
void ParseValue(const std::string& label, const OptionRule& rule, const std::string& text, T* value) {
  if (text.empty()) Refuse(label + ": '' is no value", "Leave the option out");
  if constexpr (std::is_same_v<T, bool>) {
    if (text != "true" && text != "false") Refuse(label + ": '" + text + "' is neither true nor false");
    *value = text == "true";
  } else if constexpr (std::is_arithmetic_v<T>) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *value);
    const auto number = static_cast<double>(*value);
    if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(number))
      Refuse(label + ": '" + text + "' is not a number in range");
    if (number < rule.min || number <= rule.above || number > rule.max || number >= rule.below)
      Refuse(label + ": " + text + " is out of range", "Allowed: " + RangeText(rule));
  } else {
    *value = text;
  }
}

// The number that `text` begins with, and the rest of it.
std::optional<std::pair<double, std::string>> SplitUnit(const std::string& text) {
  double number = 0;
  const char* const last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, number);
  if (error != std::errc()) return std::nullopt;
  return std::pair(number, std::string(end, last));
}

// The usage line comes first, and options go by one name each.
class HelpText : public CLI::Formatter {
 public:
  HelpText() { column_width(25); }
  std::string make_description(const CLI::App*) const override { return ""; }
  std::string make_usage(const CLI::App* app, std::string name) const override {
    std::string usage = "usage: " + name;
    for (const CLI::Option* option : app->get_options({})) {
      if (option->get_positional()) usage += " " + make_option_usage(option);
    }
    return usage + " [options]\n\n" + app->get_description() + "\n";
  }
  std::string make_option_name(const CLI::Option* option, bool is_positional) const override {
    return option->get_name(is_positional);
  }
  std::string make_option_opts(const CLI::Option*) const override { return ""; }
};

}  // namespace

struct Options::Option {
  std::string name, help;
  Field field;
  OptionRule rule;
  bool positional;
  std::string origin = "default";

  void Assign(const std::string& text) const {
    const std::string label = positional ? name : "--" + name;
    std::visit([&](auto* value) { ParseValue(label, rule, text, value); }, field);
    if (!rule.choices.empty() && std::count(rule.choices.begin(), rule.choices.end(), ValueText()) == 0)
      Refuse(label + ": '" + text + "' is unknown", fmt::format("Known: {}", fmt::join(rule.choices, ", ")));
    if (rule.check) rule.check(name, text);
  }

  // JSON types are taken at their word: "5" is no number and 5 is no file name.
  void AssignJson(const std::filesystem::path& file, const Json& value) const {
    const bool is_text =
        std::holds_alternative<std::string*>(field) || std::holds_alternative<std::filesystem::path*>(field);
    const bool fits = is_text                                ? value.is_string()
                      : std::holds_alternative<bool*>(field) ? value.is_boolean()
                                                             : value.is_number();
    if (!fits) {
      Refuse(file.string() + ": \"" + name + "\": " + io::DumpJson(value) + " has the wrong type",
             std::string("Write ") + (is_text ? "a string" : "a number, or true or false for a switch"));
    }
    Assign(is_text ? value.get<std::string>() : io::DumpJson(value));
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

  std::string ValueText() const {
    if (const auto* d = std::get_if<double*>(&field)) {
      char text[32];  // the shortest that reads back the same: at most 24 characters
      return std::string(text, std::to_chars(text, text + sizeof text, **d).ptr);
    }
    const Json value = Value();
    return value.is_string() ? value.get<std::string>() : io::DumpJson(value);
  }
};

Options::Options(const std::string& program, const std::string& description)
    : app_(std::make_unique<CLI::App>(description, program)) {
  app_->formatter(std::make_shared<HelpText>());
  app_->allow_extras();  // RefuseArgument names the nearest option
  app_->add_option("--config")->take_last()->description("JSON file with option values; flags win");
}

Options::~Options() = default;

void Options::Add(const std::string& name, Field field, const std::string& help, const OptionRule& rule) {
  Option* option =
      options_.emplace_back(std::make_unique<Option>(Option{name, help, field, rule, false})).get();
  const std::string range = RangeText(rule), value = io::DumpJson(option->Value());
  const bool is_switch = std::holds_alternative<bool*>(field);
  (is_switch ? app_->add_flag("--" + name + ",!--no-" + name) : app_->add_option("--" + name))
      ->take_last()
      ->each([option](const std::string& text) { option->Assign(text), option->origin = "flag"; })
      ->description(help + (range.empty() ? "" : "; " + range) + (value == "\"\"" ? "" : " [" + value + "]"));
}

void Options::AddPositional(const std::string& name, Field field, const std::string& help, bool required) {
  OptionRule rule{.affects_result = false};
  Option* option =
      options_.emplace_back(std::make_unique<Option>(Option{name, help, field, rule, true})).get();
  app_->add_option(name)->required(required)->description(help)->each(
      [option](const std::string& text) { option->Assign(text), option->origin = "flag"; });
}

void Options::AddFrom(const Options& other,
                      const std::string& other_name,
                      const std::string& name,
                      const std::string& note) {
  const Option& option = other.Find(other_name);
  Add(name, option.field, option.help + (note.empty() ? "" : " (" + note + ")"), option.rule);
}

Options::Option& Options::Find(const std::string& name) const {
  std::vector<std::string> names;
  for (const auto& option : options_) {
    if (option->positional) continue;
    if (option->name == name) return *option;
    names.push_back(option->name);
  }
  const std::string nearest = NearestName(name, names);
  Refuse(app_->get_name() + ": unknown option '" + name + "'",
         nearest.empty() ? "See --help" : "Did you mean --" + nearest + "? See --help");
}

void Options::RefuseArgument(const std::string& argument) const {
  if (argument.size() < 2 || argument[0] != '-')
    Refuse(app_->get_name() + ": unexpected argument '" + argument + "'");
  if (argument[1] != '-') {
    Refuse(app_->get_name() + ": unknown option '" + argument + "'",
           "Options begin with two dashes; write -- before a name that begins with one");
  }
  const std::string name = argument.substr(2, argument.find('=') - 2);
  const std::string positive = name.starts_with("no-") ? name.substr(3) : name;
  Find(positive);
  Refuse("--" + name + ": --" + positive + " is no switch");
}

bool Options::Parse(int argc, const char* const* argv) {
  for (int i = 1; i < argc && std::string(argv[i]) != "--"; ++i) {  // what CLI11 would read differently
    const std::string argument = argv[i], name = argument.substr(0, argument.find('='));
    if (!name.starts_with("--") || name == argument) continue;
    if (name + "=" == argument) Refuse(name + ": '' is no value", "Leave the option out");
    if (name.starts_with("--no-")) Refuse(app_->get_name() + ": " + name + " takes no value");
  }
  try {
    app_->parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    std::fputs(app_->help().c_str(), stdout);
    return false;
  } catch (const CLI::RequiredError& error) {  // "INPUT is required"
    const std::string text = error.what();
    Refuse(app_->get_name() + ": " + text.substr(0, text.find(' ')) + " is missing");
  } catch (const CLI::ArgumentMismatch& error) {  // "--steps: 1 required TEXT missing"
    const std::string text = error.what();
    Refuse(app_->get_name() + ": " + text.substr(0, text.find(':')) + " needs a value");
  }
  for (const std::string& argument : app_->remaining()) {
    if (argument != "--") RefuseArgument(argument);
  }
  const CLI::Option* config = app_->get_option("--config");
  if (config->count() > 0) ReadConfig(config->as<std::string>());
  for (const auto& option : options_) {
    if (!option->rule.required.empty() && option->ValueText().empty())
      Refuse(fmt::format("{}: --{} {} is missing", app_->get_name(), option->name, option->rule.required));
  }
  return true;
}

void Options::ReadConfig(const std::filesystem::path& path) {
  std::set<std::string> keys;
  const auto check_keys = [&](int depth, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::key && depth == 1 && !keys.insert(parsed.get<std::string>()).second)
      Refuse(path.string() + ": \"" + parsed.get<std::string>() + "\" is given twice", "");
    return true;
  };
  Json config;
  try {
    config = Json::parse(io::ReadFile(path, kMaxConfigBytes), check_keys);
  } catch (const Json::exception& error) {
    Refuse(path.string() + ": " + error.what(), "");
  }
  if (!config.is_object()) Refuse(path.string() + ": is not a JSON object", "");
  for (const auto& [key, value] : config.items()) {
    Option& option = Find(key);
    if (option.origin == "flag") continue;
    option.AssignJson(path, value);
    option.origin = "file";
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

bool Options::IsSetByUser(const std::string& name) const {
  const std::string& origin = Find(name).origin;
  return origin == "flag" || origin == "file";
}

std::vector<std::string> Options::NamesSetByUser() const {
  std::vector<std::string> names;
  for (const auto& option : options_) {
    if (!option->positional && IsSetByUser(option->name)) names.push_back(option->name);
  }
  return names;
}

std::string Options::ValueText(const std::string& name) const { return Find(name).ValueText(); }

Json Options::ResolvedJson() const {
  Json json = Json::object();
  for (const auto& option : options_)
    json[option->name] = {{"value", option->Value()}, {"origin", option->origin}};
  return json;
}

std::string Options::KeyText() const {
  Json json = Json::object();
  for (const auto& option : options_) {
    if (option->rule.affects_result) json[option->name] = option->Value();
  }
  return io::DumpJson(json);
}

double ParseDuration(const std::string& option_name, const std::string& text) {
  const auto parts = SplitUnit(text);
  const std::string unit = parts ? parts->second : "?";
  const double unit_s = unit.empty() || unit == "s" ? 1 : unit == "m" ? 60 : unit == "h" ? 3600 : 0;
  const double seconds = unit_s > 0 ? parts->first * unit_s : 0;
  if (!(seconds > 0 && seconds <= kMaxDuration_s)) {
    Refuse("--" + option_name + ": '" + text + "' is not a duration of up to 30 days",
           "Write for example 90s, 5m or 1.5h");
  }
  return seconds;
}

double ParseDecibels(const std::string& option_name, const std::string& text) {
  const auto parts = SplitUnit(text);
  const bool has_unit = parts && (parts->second.empty() || parts->second == "dB");
  if (!has_unit || !(parts->first > 0 && parts->first < 100))
    Refuse("--" + option_name + ": '" + text + "' is not a number of decibels", "Write for example 30dB");
  return parts->first;
}

std::string NearestName(const std::string& name, const std::vector<std::string>& candidates) {
  const auto nearest =
      std::min_element(candidates.begin(), candidates.end(), [&](const auto& a, const auto& b) {
        return EditDistance(name, a) < EditDistance(name, b);
      });
  return nearest == candidates.end() ? "" : *nearest;
}

}  // namespace pipeline
