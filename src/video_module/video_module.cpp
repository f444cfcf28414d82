// SPDX-License-Identifier: MIT
// Loaded by dataset/video_stream.cpp; the only source that links OpenCV's videoio.
#include <cstdlib>
#include <memory>
#include <string>
#include <utility>

#include <opencv2/core/utility.hpp>
#include <opencv2/videoio.hpp>

#include "dataset/video_decoder.hpp"

namespace stemvo::dataset {
namespace {

VideoDecoder decoder_of(cv::VideoCapture capture, int turned_deg) {  // copies share the video
  VideoDecoder decoder;
  decoder.size = {static_cast<int>(capture.get(cv::CAP_PROP_FRAME_WIDTH)),
                  static_cast<int>(capture.get(cv::CAP_PROP_FRAME_HEIGHT))};
  if (turned_deg % 180 != 0) {
    std::swap(decoder.size.width, decoder.size.height);
  }
  decoder.frame_count = capture.get(cv::CAP_PROP_FRAME_COUNT);
  decoder.rate_hz = capture.get(cv::CAP_PROP_FPS);
  decoder.turned_deg = turned_deg;
  const auto tag = static_cast<unsigned>(capture.get(cv::CAP_PROP_CODEC_PIXEL_FORMAT));
  // FFmpeg's: "Y1", 0, bits; reversed where the high byte comes first.
  decoder.gray_bits = (tag & 0xffffffU) == 0x003159U ? tag >> 24U
                      : tag >> 8U == 0x593100U       ? tag & 0xffU
                                                     : 8U;
  decoder.grab = [capture]() mutable { return capture.grab(); };
  decoder.position_ms = [capture] { return capture.get(cv::CAP_PROP_POS_MSEC); };
  decoder.retrieve = [capture, turned_deg]() mutable {
    cv::Mat bgr;
    if (capture.retrieve(bgr) && turned_deg != 0) {
      cv::rotate(bgr, bgr,
                 turned_deg == 90    ? cv::ROTATE_90_CLOCKWISE
                 : turned_deg == 180 ? cv::ROTATE_180
                                     : cv::ROTATE_90_COUNTERCLOCKWISE);
    }
    return bgr;
  };
  return decoder;
}

/// The turn the container asks for, clockwise. We turn frames: OpenCV 4.6 turns them the wrong way
/// (its issue 22088), and later ones not unless they are asked.
int asked_turn_deg(cv::VideoCapture& capture) {
  capture.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);
  const int told_deg = cvRound(capture.get(cv::CAP_PROP_ORIENTATION_META));
  const bool is_reversed = cv::getVersionMajor() == 4 && cv::getVersionMinor() == 6;
  const int turn_deg = ((is_reversed ? -told_deg : told_deg) % 360 + 360) % 360;
  return turn_deg % 90 == 0 ? turn_deg : 0;  // players turn by the other angles, we do not
}

cv::VideoCapture open_file(const char* file) {
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);  // errors are ours to tell
  // A playlist may name anything: one of this machine no address, one of another no file.
  ::setenv("OPENCV_FFMPEG_CAPTURE_OPTIONS",
           file[0] == '/' ? "protocol_whitelist;file"
                          : "rtsp_transport;tcp|protocol_whitelist;rtsp,rtp,udp,tcp,tls,http,https",
           1);
  return cv::VideoCapture(file, cv::CAP_FFMPEG);
}

}  // namespace

extern "C" __attribute__((visibility("default"))) bool stemvo_open_decoder(const char* file,
                                                                           int number,
                                                                           const cv::Size& wanted,
                                                                           VideoDecoder& decoder) {
  cv::VideoCapture capture =
      file != nullptr ? open_file(file) : cv::VideoCapture(number, cv::CAP_V4L2);
  if (file == nullptr) {
    capture.set(cv::CAP_PROP_FRAME_WIDTH, wanted.width);
    capture.set(cv::CAP_PROP_FRAME_HEIGHT, wanted.height);
  }
  if (!capture.isOpened()) {
    return false;
  }
  decoder = decoder_of(capture, file != nullptr ? asked_turn_deg(capture) : 0);
  const VideoDecoder plain = decoder_of(capture, 0);
  // As players show it, but where the calibration is of the sensor's rows and columns.
  decoder = decoder.size != wanted && plain.size == wanted ? plain : decoder;
  return true;
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
        constexpr double kMinShare = 0.9;                        // containers without a count guess
        const cv::VideoCapture whole = open_file(name.c_str());  // with a file's options again
        return whole.isOpened() && whole.get(cv::CAP_PROP_FRAME_COUNT) >= kMinShare * count;
      };
      return true;
    }
  }
  return false;
}

}  // namespace stemvo::dataset
