#include "io/base/gzip.h"

#include <gtest/gtest.h>
#include <zlib.h>

namespace io {
namespace {

std::string Unpacked(const std::string& bytes, std::size_t size) {
  z_stream stream = {};
  EXPECT_EQ(inflateInit2(&stream, 15 + 16), Z_OK);  // gzip's header, and no other
  std::string out(size + 1, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  inflateEnd(&stream);
  return out;
}

TEST(Gzip, IsReadBack) {
  std::string bytes;
  for (unsigned i = 0; i < 100000; ++i) bytes += static_cast<char>(i * i >> 7);
  for (const std::string& text : {std::string(), std::string("a"), bytes})
    EXPECT_EQ(Unpacked(Gzip(text), text.size()), text);
  EXPECT_LT(Gzip(std::string(100000, 'a')).size(), 1000u);
}

}  // namespace
}  // namespace io
