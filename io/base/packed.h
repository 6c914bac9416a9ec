// Values as bytes, one after the other as they lie in memory: what processes of the same program tell each
// other. Strings and vectors begin with their length.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "io/base/check.h"

namespace io {

class Packer {
 public:
  template <typename T>
  Packer& Add(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  Packer& Add(const std::string& text) {
    Add(std::uint64_t{text.size()});
    bytes_ += text;
    return *this;
  }
  template <typename T>
  Packer& Add(const std::vector<T>& values) {
    Add(std::uint64_t{values.size()});
    if constexpr (std::is_trivially_copyable_v<T>) {
      bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    } else {
      for (const T& value : values) Add(value);
    }
    return *this;
  }
  // The bytes so far.
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

// Takes values in the order in which they were added, with the same types. The bytes must outlive it.
class Unpacker {
 public:
  explicit Unpacker(std::string_view bytes) : bytes_(bytes) {}

  template <typename T>
  void Take(T* value) {
    static_assert(std::is_trivially_copyable_v<T>);
    Copy(value, sizeof *value);
  }
  void Take(std::string* text) {
    text->resize(Length());
    Copy(text->data(), text->size());
  }
  template <typename T>
  void Take(std::vector<T>* values) {
    values->resize(Length());
    if constexpr (std::is_trivially_copyable_v<T>) {
      Copy(values->data(), values->size() * sizeof(T));
    } else {
      for (T& value : *values) Take(&value);
    }
  }
  template <typename T>
  T Take() {
    T value;
    Take(&value);
    return value;
  }

 private:
  std::size_t Length() {
    const auto length = Take<std::uint64_t>();
    PIPELINE_CHECK(length <= bytes_.size());
    return length;
  }
  void Copy(void* to, std::size_t n) {
    PIPELINE_CHECK(n <= bytes_.size());
    if (n > 0) std::memcpy(to, bytes_.data(), n);
    bytes_.remove_prefix(n);
  }

  std::string_view bytes_;
};

}  // namespace io
