// Pictures into files in memory, through OpenCV.
#pragma once

#include <cstdint>
#include <vector>

namespace cv {
class Mat;
}

namespace io {

// extension: ".png". parameters: as cv::imencode takes them.
std::vector<std::uint8_t> EncodeWithOpenCv(const char* extension,
                                           const cv::Mat& bgr,
                                           const std::vector<int>& parameters = {});

}  // namespace io
