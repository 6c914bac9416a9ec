// The JSON that this program writes and reads back; that of others is read by json_reader.h. Parser and
// writer are compiled once: they are the larger part of what a source that uses <nlohmann/json.hpp> compiles.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace io {

using Json = nlohmann::ordered_json;  // keys stay in the order in which they were set

// A value that is_discarded() where the text is no JSON.
Json ParseJson(const std::string& text);

// In lines, each level indented by `indent` spaces; without it in one line. What is not UTF-8 becomes U+FFFD.
std::string DumpJson(const Json& json, int indent = -1);

}  // namespace io
