// Text inside other text: words of a shell command, fields of a table.
#pragma once

#include <string>

namespace io {

// The word as one types it in a POSIX shell: in single quotes unless all its characters are plain.
std::string ShellWord(const std::string& word);

// A field of CSV (RFC 4180) in double quotes, its own doubled; CsvField quotes only where a comma, a quote or
// a line break demands it.
std::string CsvQuoted(const std::string& field);
std::string CsvField(const std::string& field);

}  // namespace io
