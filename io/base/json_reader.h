// Strict access to JSON that others wrote. Parsing refuses duplicate keys, deep nesting, NaN and overflow;
// the typed getters never convert: a wrong type, a fraction where a whole number belongs, or a value out of
// range is an error that names the file and the place ("transforms.json: frames[3].w: 800.7 is not a whole
// number").
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace io {

struct JsonNode;

// One value of a parsed document. Copies are cheap and keep the document alive.
class JsonReader {
 public:
  // Throws kBadInput with line and column. Limits: 256 MB, 64 levels, 8 million values. A byte order mark is
  // accepted.
  static JsonReader ReadDocument(const std::filesystem::path& path);
  // The same of a text; `name` stands for the file in messages.
  static JsonReader ParseDocument(const std::string& text, const std::string& name);

  // All getters but IsNull throw kBadInput naming file and JSON path.
  bool Has(const std::string& key) const;
  JsonReader At(const std::string& key) const;
  std::vector<std::string> Keys() const;
  std::size_t Size() const;  // of an array
  JsonReader At(std::size_t index) const;
  double Number(double min, double max) const;
  int Integer(int min, int max) const;
  bool Bool() const;
  bool IsNull() const;
  const std::string& String() const;

  const std::string& json_path() const { return json_path_; }
  [[noreturn]] void Fail(const std::string& what, const std::string& remedy = "") const;

 private:
  JsonReader(std::shared_ptr<const std::string> file,
             std::shared_ptr<const JsonNode> node,
             std::string json_path)
      : file_(std::move(file)), node_(std::move(node)), json_path_(std::move(json_path)) {}

  std::shared_ptr<const std::string> file_;
  std::shared_ptr<const JsonNode> node_;  // shares the ownership of the whole document
  std::string json_path_;                 // "frames[3].w"; empty for the document
};

}  // namespace io
