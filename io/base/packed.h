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
  template <typename T, typename Allocator>
  Packer& Add(const std::vector<T, Allocator>& values) {
    Add(std::uint64_t{values.size()});
    if constexpr (std::is_trivially_copyable_v<T>) {
      AddValues(values.data(), values.size());
    } else {
      for (const T& value : values) Add(value);
    }
    return *this;
  }
  // Without their number.
  template <typename T>
  Packer& AddValues(const T* values, std::size_t n) {
    static_assert(std::is_trivially_copyable_v<T>);
    bytes_.append(reinterpret_cast<const char*>(values), n * sizeof(T));
    return *this;
  }
  // Makes room for so many bytes in all.
  void Reserve(std::size_t n) { bytes_.reserve(n); }
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
  template <typename T, typename Allocator>
  void Take(std::vector<T, Allocator>* values) {
    values->resize(Length());
    if constexpr (std::is_trivially_copyable_v<T>) {
      TakeValues(values->data(), values->size());
    } else {
      for (T& value : *values) Take(&value);
    }
  }
  template <typename T>
  void TakeValues(T* values, std::size_t n) {
    static_assert(std::is_trivially_copyable_v<T>);
    Copy(values, n * sizeof(T));
  }
  template <typename T>
  T Take() {
    T value;
    Take(&value);
    return value;
  }
  bool IsEmpty() const { return bytes_.empty(); }

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
