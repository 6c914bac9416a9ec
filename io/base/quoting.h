// Text inside other text: words of a shell command, fields of a table, names from files in a message.
#pragma once

#include <string>

namespace io {

// The word as one types it in a POSIX shell: in single quotes unless all its characters are plain.
std::string ShellWord(const std::string& word);

// For a terminal or a log: control characters except line breaks, and bytes that are not UTF-8, as \xNN. A
// file name or a key of JSON can then neither move the cursor nor change colours.
std::string Printable(const std::string& text);

// A field of CSV (RFC 4180) in double quotes, its own doubled; CsvField quotes only where a comma, a quote or
// a line break demands it.
std::string CsvQuoted(const std::string& field);
std::string CsvField(const std::string& field);

}  // namespace io
