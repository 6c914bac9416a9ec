#include "pipeline/options.h"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>

#include "io/atomic_file.h"
#include "io/error.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
using Json = nlohmann::ordered_json;

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
  if (error != std::errc() || end != text.data() + text.size()) {
    throw Error(ExitCode::kUsage, "--" + name + ": '" + text + "' is not a number in range");
  }
}

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
  for (const auto& option : options_) {
    if (option->name == name && !option->positional) return option.get();
  }
  const Option* nearest = nullptr;
  for (const auto& option : options_) {
    if (!option->positional &&
        (!nearest || EditDistance(name, option->name) < EditDistance(name, nearest->name))) {
      nearest = option.get();
    }
  }
  throw Error(ExitCode::kUsage,
              program_ + ": unknown option '" + name + "'",
              nearest ? "Did you mean --" + nearest->name + "? See --help" : "See --help");
}

bool Options::Parse(int argc, const char* const* argv) {
  std::vector<Option*> positional;
  for (const auto& option : options_) {
    if (option->positional) positional.push_back(option.get());
  }
  std::size_t n_positional = 0;
  std::filesystem::path config;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--help" || argument == "-h") {
      PrintHelp();
      return false;
    }
    if (argument.rfind("--", 0) != 0) {
      if (n_positional == positional.size())
        throw Error(ExitCode::kUsage, program_ + ": unexpected argument '" + argument + "'", "See --help");
      positional[n_positional]->Assign(argument);
      positional[n_positional++]->origin = "flag";
      continue;
    }
    const std::size_t equals = argument.find('=');
    std::string name = argument.substr(2, equals == std::string::npos ? equals : equals - 2);
    const auto next_value = [&]() -> std::string {
      if (equals != std::string::npos) return argument.substr(equals + 1);
      if (i + 1 >= argc)
        throw Error(ExitCode::kUsage, program_ + ": --" + name + " needs a value", "See --help");
      return argv[++i];
    };
    if (name == "config") {
      config = next_value();
      continue;
    }
    bool negated = false;
    if (name.rfind("no-", 0) == 0 &&
        std::none_of(options_.begin(), options_.end(), [&](const auto& o) { return o->name == name; })) {
      negated = true;
      name = name.substr(3);
    }
    Option* option = Find(name);
    if (std::holds_alternative<bool*>(option->field)) {
      option->Assign(equals != std::string::npos ? next_value() : negated ? "false" : "true");
    } else {
      option->Assign(next_value());
    }
    option->origin = "flag";
  }
  if (!config.empty()) ReadConfig(config);
  if (n_positional < positional.size() && positional[n_positional]->required) {
    throw Error(
        ExitCode::kUsage, program_ + ": " + positional[n_positional]->name + " is missing", "See --help");
  }
  return true;
}

void Options::ReadConfig(const std::filesystem::path& path) {
  const Json config = Json::parse(io::ReadFile(path, 1 << 20), nullptr, false);
  if (!config.is_object()) throw Error(ExitCode::kUsage, path.string() + ": is not a JSON object");
  for (const auto& [key, value] : config.items()) {
    Option* option = Find(key);
    if (option->origin == "flag") continue;
    option->Assign(value.is_string() ? value.get<std::string>() : value.dump());
    option->origin = "file";
  }
}

void Options::SetMeasured(const std::string& name) { Find(name)->origin = "measured"; }

bool Options::IsSetByUser(const std::string& name) const {
  const std::string& origin = Find(name)->origin;
  return origin == "flag" || origin == "file";
}

std::string Options::ResolvedJson() const {
  Json json = Json::object();
  for (const auto& option : options_)
    json[option->name] = {{"value", option->Value()}, {"origin", option->origin}};
  return json.dump();
}

std::string Options::KeyText() const {
  Json json = Json::object();
  for (const auto& option : options_) {
    if (option->affects_result) json[option->name] = option->Value();
  }
  return json.dump();
}

void Options::PrintHelp() const {
  std::string usage = "usage: " + program_;
  for (const auto& option : options_) {
    if (option->positional) usage += option->required ? " " + option->name : " [" + option->name + "]";
  }
  std::printf("%s [options]\n\n%s\n\n", usage.c_str(), description_.c_str());
  for (const auto& option : options_) {
    const std::string left = option->positional ? option->name : "--" + option->name;
    const std::string value = option->Value().dump();
    const bool show = !option->positional && value != "\"\"";
    std::printf(
        "  %-20s %s%s\n", left.c_str(), option->help.c_str(), show ? (" [" + value + "]").c_str() : "");
  }
  std::printf("  %-20s %s\n", "--config", "JSON file with option values; flags win");
}

}  // namespace pipeline
