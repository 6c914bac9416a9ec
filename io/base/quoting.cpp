#include "io/base/quoting.h"

#include <fmt/format.h>

#include <algorithm>

namespace io {
namespace {

// `text` between two of `quote`, with `inner` in place of each `quote` inside.
std::string Quoted(const std::string& text, char quote, const std::string& inner) {
  std::string quoted(1, quote);
  for (const char c : text) quoted += c == quote ? inner : std::string(1, c);
  return quoted + quote;
}

// Bytes of the UTF-8 character at `text[at]` (RFC 3629: no overlong forms, surrogates or values beyond
// U+10FFFF); 0 where there is none.
std::size_t CharacterSize(const std::string& text, std::size_t at) {
  const auto byte = [&](std::size_t i) {
    return at + i < text.size() ? static_cast<unsigned char>(text[at + i]) : 0u;
  };
  const unsigned lead = byte(0);
  if (lead < 0x80) return 1;
  const std::size_t size = lead >= 0xc2 && lead < 0xe0 ? 2 : lead >= 0xe0 && lead < 0xf0 ? 3 : 4;
  if (lead < 0xc2 || lead > 0xf4) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
  }
  const unsigned start = lead << 8 | byte(1);
  const bool is_overlong = (lead == 0xe0 && start < 0xe0a0) || (lead == 0xf0 && start < 0xf090);
  const bool is_surrogate = lead == 0xed && start >= 0xeda0;
  return is_overlong || is_surrogate || start >= 0xf490 ? 0 : size;
}

// C0, DEL and the C1 set (U+0080 to U+009F, in UTF-8 a lead byte 0xc2).
bool IsControl(const std::string& character) {
  const auto first = static_cast<unsigned char>(character[0]);
  if (character.size() == 1) return (first < 0x20 && first != '\n') || first == 0x7f;
  return first == 0xc2 && static_cast<unsigned char>(character[1]) < 0xa0;
}

}  // namespace

std::string ShellWord(const std::string& word) {
  constexpr const char* kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./:,@%";
  const bool is_plain = !word.empty() && word.find_first_not_of(kPlain) == std::string::npos;
  return is_plain ? word : Quoted(word, '\'', "'\\''");
}

std::string Printable(const std::string& text) {
  std::string printable;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t size = CharacterSize(text, at);
    const std::string character = text.substr(at, std::max<std::size_t>(size, 1));
    at += character.size();
    if (size > 0 && !IsControl(character)) {
      printable += character;
      continue;
    }
    for (const char c : character) printable += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
  }
  return printable;
}

std::string CsvQuoted(const std::string& field) { return Quoted(field, '"', "\"\""); }

std::string CsvField(const std::string& field) {
  return field.find_first_of(",\"\n\r") == std::string::npos ? field : CsvQuoted(field);
}

}  // namespace io
