#include "io/base/quoting.h"

namespace io {
namespace {

// `text` between two of `quote`, with `inner` in place of each `quote` inside.
std::string Quoted(const std::string& text, char quote, const std::string& inner) {
  std::string quoted(1, quote);
  for (const char c : text) quoted += c == quote ? inner : std::string(1, c);
  return quoted + quote;
}

}  // namespace

std::string ShellWord(const std::string& word) {
  constexpr const char* kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./:,@%";
  const bool is_plain = !word.empty() && word.find_first_not_of(kPlain) == std::string::npos;
  return is_plain ? word : Quoted(word, '\'', "'\\''");
}

std::string CsvQuoted(const std::string& field) { return Quoted(field, '"', "\"\""); }

std::string CsvField(const std::string& field) {
  return field.find_first_of(",\"\n\r") == std::string::npos ? field : CsvQuoted(field);
}

}  // namespace io
