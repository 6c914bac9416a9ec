#include "io/image/opencv_encode.h"

#include <cerrno>
#include <new>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>

#include "io/base/check.h"
#include "io/base/memory.h"

namespace io {
namespace {

// OpenCV says by an exception of its own that memory lacks; programs know std::bad_alloc. Holds for every
// call of OpenCV from the program's start on.
int ThrowBadAlloc(int code, const char*, const char*, const char*, int, void*) {
  if (code == cv::Error::StsNoMem) throw std::bad_alloc();
  return 0;
}
[[maybe_unused]] const cv::ErrorCallback before = cv::redirectError(ThrowBadAlloc);

}  // namespace

std::vector<std::uint8_t> EncodeWithOpenCv(const char* extension,
                                           const cv::Mat& bgr,
                                           const std::vector<int>& parameters) {
  std::vector<std::uint8_t> bytes;
  bool written = false;
  errno = 0;
  try {
    written = cv::imencode(extension, bgr, bytes, parameters);
  } catch (const cv::Exception&) {
    ThrowIfMemoryWasRefused();
    throw;
  }
  PIPELINE_CHECK(written);
  return bytes;
}

}  // namespace io
