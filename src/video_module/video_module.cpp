// SPDX-License-Identifier: MIT
// Loaded by dataset/video_decoder.cpp; the only source that links OpenCV's videoio.
#include <cstdlib>
#include <memory>
#include <string>

#include <opencv2/videoio.hpp>

#include "dataset/video_decoder.hpp"

namespace stemvo::dataset {

namespace {

class OpenCvDecoder final : public VideoDecoder {
 public:
  explicit OpenCvDecoder(const cv::VideoCapture& capture) : capture_(capture) {}  // shared

  bool grab() override { return capture_.grab(); }
  cv::Mat retrieve() override {
    cv::Mat bgr;
    capture_.retrieve(bgr);
    return bgr;
  }
  cv::Size size() const override {
    return {static_cast<int>(capture_.get(cv::CAP_PROP_FRAME_WIDTH)),
            static_cast<int>(capture_.get(cv::CAP_PROP_FRAME_HEIGHT))};
  }
  double frame_count() const override { return capture_.get(cv::CAP_PROP_FRAME_COUNT); }
  double rate_hz() const override { return capture_.get(cv::CAP_PROP_FPS); }
  double position_ms() const override { return capture_.get(cv::CAP_PROP_POS_MSEC); }
  double turned_deg() const override {
    return capture_.get(cv::CAP_PROP_ORIENTATION_AUTO) != 0.0
               ? capture_.get(cv::CAP_PROP_ORIENTATION_META)
               : 0.0;
  }

 private:
  cv::VideoCapture capture_;
};

cv::VideoCapture open_file(const char* file, const cv::Size& wanted) {
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);  // errors are ours to tell
  // A playlist may name anything: one of this machine no address, one of another no file.
  ::setenv("OPENCV_FFMPEG_CAPTURE_OPTIONS",
           file[0] == '/' ? "protocol_whitelist;file"
                          : "rtsp_transport;tcp|protocol_whitelist;rtsp,rtp,udp,tcp,tls,http,https",
           1);
  cv::VideoCapture capture(file, cv::CAP_FFMPEG);
  // As players show it, but where the calibration is of the sensor's rows and columns.
  capture.set(cv::CAP_PROP_ORIENTATION_AUTO, 1);
  const cv::Size turned = OpenCvDecoder(capture).size();
  if (turned != wanted && cv::Size(turned.height, turned.width) == wanted) {
    capture.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);
  }
  return capture;
}

cv::VideoCapture open_camera(int number, int width_px, int height_px) {
  cv::VideoCapture capture(number, cv::CAP_V4L2);
  capture.set(cv::CAP_PROP_FRAME_WIDTH, width_px);
  capture.set(cv::CAP_PROP_FRAME_HEIGHT, height_px);
  return capture;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) VideoDecoder* stemvo_open_decoder(
    const char* file, int number, int width_px, int height_px) {
  const cv::VideoCapture capture = file != nullptr ? open_file(file, {width_px, height_px})
                                                   : open_camera(number, width_px, height_px);
  return capture.isOpened() ? std::make_unique<OpenCvDecoder>(capture).release() : nullptr;
}

extern "C" __attribute__((visibility("default"))) bool stemvo_open_writer(const char* file,
                                                                          double rate_hz,
                                                                          const cv::Size& size,
                                                                          WriteFrame& write) {
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
  for (const int codec :
       {cv::VideoWriter::fourcc('a', 'v', 'c', '1'),  // browsers play it
        cv::VideoWriter::fourcc('m', 'p', '4', 'v'), cv::VideoWriter::fourcc('M', 'J', 'P', 'G')}) {
    const auto writer =
        std::make_shared<cv::VideoWriter>(file, cv::CAP_FFMPEG, codec, rate_hz, size);
    if (writer->isOpened()) {
      write = [writer, count = 0.0, name = std::string(file)](const cv::Mat& bgr) mutable {
        if (!bgr.empty()) {
          writer->write(bgr);
          ++count;
          return true;
        }
        writer->release();  // which tells no errors: a full disk leaves fewer frames, or none
        constexpr double kMinShare = 0.9;  // containers without a count guess
        const cv::VideoCapture whole(name, cv::CAP_FFMPEG);
        return whole.isOpened() && whole.get(cv::CAP_PROP_FRAME_COUNT) >= kMinShare * count;
      };
      return true;
    }
  }
  return false;
}

}  // namespace stemvo::dataset
