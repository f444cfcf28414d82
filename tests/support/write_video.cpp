// SPDX-License-Identifier: MIT
// write_video FILE.avi RATE_HZ IMAGE..: a program of its own, for only what links OpenCV's videoio
// starts slowly.
#include <cstdio>
#include <cstdlib>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

int main(int argc, char** argv) {
  if (argc < 4) {
    return EXIT_FAILURE;
  }
  cv::VideoWriter writer;
  for (int i = 3; i < argc; ++i) {
    const cv::Mat image = cv::imread(argv[i]);
    if (image.empty() ||
        (!writer.isOpened() &&
         !writer.open(argv[1], cv::CAP_FFMPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'),
                      std::atof(argv[2]), image.size()))) {
      std::fprintf(stderr, "%s: no image, or no video can be written\n", argv[i]);
      return EXIT_FAILURE;
    }
    writer.write(image);
  }
  return EXIT_SUCCESS;
}
