#include "io/base/gzip.h"

#include <zlib.h>

#include "io/base/check.h"

namespace io {

std::string Gzip(std::string_view bytes) {
  // zlib's defaults, in the level too: the best one makes a page 0.3 % smaller and takes three times as long.
  // 16 more bits of window ask for gzip's header and sum.
  constexpr int kGzipWindow = 15 + 16, kMemory = 8;
  z_stream stream = {};
  PIPELINE_CHECK_EQ(
      deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, kGzipWindow, kMemory, Z_DEFAULT_STRATEGY),
      Z_OK);
  std::string out(deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  const int result = deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  PIPELINE_CHECK_EQ(result, Z_STREAM_END);
  return out;
}

}  // namespace io
