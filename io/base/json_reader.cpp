// A small document tree filled by nlohmann-json's streaming parser: limits hold before anything is built, and
// the library's silent conversions (1e30 to INT_MIN, -5 to 4294967291, last duplicate wins) cannot happen.
#include "io/base/json_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <sstream>
#include <variant>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/json.h"

namespace io {

struct JsonObject {
  std::vector<std::string> keys;
  std::vector<JsonNode> values;        // same order as keys
  std::vector<std::uint32_t> by_name;  // indices of keys, sorted by key

  // The value of `key`; null when absent.
  const JsonNode* Find(const std::string& key) const;
};

struct JsonNode {
  std::variant<std::nullptr_t, bool, double, std::string, std::vector<JsonNode>, JsonObject> value;
};

const JsonNode* JsonObject::Find(const std::string& key) const {
  const auto it =
      std::lower_bound(by_name.begin(), by_name.end(), key, [&](std::uint32_t i, const std::string& k) {
        return keys[i] < k;
      });
  return it != by_name.end() && keys[*it] == key ? &values[*it] : nullptr;
}

namespace {

constexpr std::size_t kMaxBytes = std::size_t{256} << 20;
constexpr std::size_t kMaxDepth = 64;           // real files have 4 levels
constexpr std::size_t kMaxValues = 8'000'000;   // 300,000 frames; bounds the tree to about 500 MB
constexpr std::size_t kMaxMessageLength = 200;  // parse errors quote the input, which may be one endless line

// Receives the parser's events. A returned false stops the parser; `refusal` then says why.
class TreeBuilder : public nlohmann::json_sax<Json> {
 public:
  bool null() override { return Add({nullptr}); }
  bool boolean(bool value) override { return Add({value}); }
  bool number_integer(number_integer_t value) override { return Add({static_cast<double>(value)}); }
  bool number_unsigned(number_unsigned_t value) override { return Add({static_cast<double>(value)}); }
  bool number_float(number_float_t value, const string_t&) override { return Add({value}); }
  bool string(string_t& value) override { return Add({std::move(value)}); }
  bool binary(binary_t&) override { return Refuse("binary value"); }
  bool start_array(std::size_t) override { return Open({std::vector<JsonNode>()}); }
  bool end_array() override { return Close(); }
  bool start_object(std::size_t) override { return Open({JsonObject()}); }
  bool end_object() override {
    auto& object = std::get<JsonObject>(levels_.back().value);
    const std::vector<std::string>& keys = object.keys;
    object.by_name.resize(keys.size());
    std::iota(object.by_name.begin(), object.by_name.end(), 0u);
    std::sort(
        object.by_name.begin(), object.by_name.end(), [&](auto a, auto b) { return keys[a] < keys[b]; });
    const auto twice = std::adjacent_find(
        object.by_name.begin(), object.by_name.end(), [&](auto a, auto b) { return keys[a] == keys[b]; });
    if (twice != object.by_name.end()) return Refuse("key \"" + keys[*twice] + "\" occurs twice");
    return Close();
  }

  bool key(string_t& value) override {
    std::get<JsonObject>(levels_.back().value).keys.push_back(std::move(value));
    return true;
  }

  bool parse_error(std::size_t byte, const std::string&, const nlohmann::detail::exception& error) override {
    // "[json.exception.parse_error.101] parse error at line 1, column 2: ..."; overflow comes without a line.
    std::string what = error.what();
    const std::size_t bracket = what.find("] ");
    if (bracket != std::string::npos) what.erase(0, bracket + 2);
    return Refuse(what.find("line ") != std::string::npos ? what : fmt::format("byte {}: {}", byte, what));
  }

  std::string refusal;
  JsonNode root;

 private:
  bool Refuse(std::string why) {
    if (why.size() > kMaxMessageLength) why = why.substr(0, kMaxMessageLength) + "...";
    refusal = std::move(why);
    return false;
  }

  bool Open(JsonNode node) {
    if (levels_.size() >= kMaxDepth)
      return Refuse("nested deeper than " + std::to_string(kMaxDepth) + " levels");
    levels_.push_back(std::move(node));
    return true;
  }

  bool Close() {
    JsonNode node = std::move(levels_.back());
    levels_.pop_back();
    return Add(std::move(node));
  }

  bool Add(JsonNode node) {
    if (++values_ > kMaxValues) return Refuse("holds more than " + std::to_string(kMaxValues) + " values");
    if (levels_.empty()) {
      root = std::move(node);
    } else if (auto* items = std::get_if<std::vector<JsonNode>>(&levels_.back().value)) {
      items->push_back(std::move(node));
    } else {
      std::get<JsonObject>(levels_.back().value).values.push_back(std::move(node));
    }
    return true;
  }

  std::vector<JsonNode> levels_;  // what is open, outermost first
  std::size_t values_ = 0;
};

std::string Text(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

}  // namespace

JsonReader JsonReader::ReadDocument(const std::filesystem::path& path) {
  return ParseDocument(ReadFile(path, kMaxBytes), path.string());
}

JsonReader JsonReader::ParseDocument(const std::string& text, const std::string& name) {
  TreeBuilder builder;
  if (!Json::sax_parse(text, &builder)) {
    throw Error(ExitCode::kBadInput, name + ": " + builder.refusal, "Repair the JSON");
  }
  return {std::make_shared<const std::string>(name),
          std::make_shared<const JsonNode>(std::move(builder.root)),
          ""};
}

void JsonReader::Fail(const std::string& what, const std::string& remedy) const {
  throw Error(
      ExitCode::kBadInput, *file_ + ": " + (json_path_.empty() ? "" : json_path_ + ": ") + what, remedy);
}

bool JsonReader::Has(const std::string& key) const {
  const auto* object = std::get_if<JsonObject>(&node_->value);
  if (!object) Fail("is not an object");
  return object->Find(key) != nullptr;
}

JsonReader JsonReader::At(const std::string& key) const {
  if (!Has(key)) Fail("\"" + key + "\" is missing");
  return {file_,
          std::shared_ptr<const JsonNode>(node_, std::get<JsonObject>(node_->value).Find(key)),
          json_path_.empty() ? key : json_path_ + "." + key};
}

std::vector<std::string> JsonReader::Keys() const {
  const auto* object = std::get_if<JsonObject>(&node_->value);
  if (!object) Fail("is not an object");
  return object->keys;
}

std::size_t JsonReader::Size() const {
  const auto* items = std::get_if<std::vector<JsonNode>>(&node_->value);
  if (!items) Fail("is not an array");
  return items->size();
}

JsonReader JsonReader::At(std::size_t index) const {
  if (index >= Size()) Fail(fmt::format("has only {} elements", Size()));
  return {file_,
          std::shared_ptr<const JsonNode>(node_, &std::get<std::vector<JsonNode>>(node_->value)[index]),
          fmt::format("{}[{}]", json_path_, index)};
}

double JsonReader::Number(double min, double max) const {
  const auto* number = std::get_if<double>(&node_->value);
  if (!number) {
    Fail(IsNull() ? "is null where a number belongs (some programs write NaN so)" : "is not a number");
  }
  if (!(*number >= min && *number <= max)) {
    Fail(fmt::format("{} is outside {} to {}", Text(*number), Text(min), Text(max)));
  }
  return *number;
}

int JsonReader::Integer(int min, int max) const {
  const double number = Number(min, max);
  if (number != std::floor(number)) Fail(Text(number) + " is not a whole number");
  return static_cast<int>(number);
}

bool JsonReader::Bool() const {
  const auto* value = std::get_if<bool>(&node_->value);
  if (!value) Fail("is neither true nor false");
  return *value;
}

bool JsonReader::IsNull() const { return std::holds_alternative<std::nullptr_t>(node_->value); }

const std::string& JsonReader::String() const {
  const auto* text = std::get_if<std::string>(&node_->value);
  if (!text) Fail("is not a text");
  return *text;
}

}  // namespace io
