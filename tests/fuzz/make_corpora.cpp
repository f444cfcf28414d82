// SPDX-License-Identifier: MIT
// make_corpora OUT: for each fuzzer a folder of small files as stemvo and its tests have
// them.
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "../support/small_map.hpp"
#include "config/config.hpp"
#include "evaluation/trajectory.hpp"
#include "report/metrics_json.hpp"
#include "text/text_file.hpp"

namespace {

namespace fs = std::filesystem;
using stemvo::Status;

/// Files of one folder; the first error ends the program.
class Corpus {
 public:
  Corpus(const fs::path& out, const std::string& fuzzer) : folder_(out / fuzzer) {
    fs::create_directories(folder_);
  }
  void text(const std::string& name, const std::string& text) const {
    done(stemvo::write_text_file(folder_ / name, text));
  }
  [[nodiscard]] fs::path operator/(const std::string& name) const { return folder_ / name; }

  static void done(const Status& status) {
    if (!status) {
      std::fprintf(stderr, "make_corpora: %s\n", status.error().message.c_str());
      std::exit(1);
    }
  }

 private:
  fs::path folder_;
};

void kitti(const fs::path& out) {
  const std::string row = "718.856 0 607.1928 0 0 718.856 185.2157 0 0 0 1 0\n";
  const Corpus calib(out, "kitti_calib");
  calib.text("odometry", "P0: " + row + "P1: " + row + "P2: " + row + "P3: " + row);
  calib.text("raw", "calib_time: 09-Jan-2012\r\nP_rect_00: " + row + "P_rect_02: " + row);
  const Corpus times(out, "kitti_times");
  times.text("times", "0.000000e+00\n1.037e-01\n+0.2\n3\n");
}

void poses(const fs::path& out) {
  const Corpus corpus(out, "poses");
  stemvo::Trajectory trajectory(3);
  trajectory[1].translation = {0.1, -0.2, 1.0};
  trajectory[2].rotation = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY());
  Corpus::done(stemvo::write_kitti_trajectory(corpus / "kitti", trajectory));
  const std::vector<double> times_s = {0.0, 0.1, 0.2};
  Corpus::done(stemvo::write_tum_trajectory(corpus / "tum", times_s, trajectory));
  corpus.text("euroc",
              "#timestamp, p_x, p_y, p_z, q_w, q_x, q_y, q_z, v_x\n"
              "1403636580838555648,4.68,-1.78,0.78,1,0,0,0,-0.02\n"
              "1403636580843555328,4.69,-1.79,0.78,0.6,0,0.8,0,-0.02\n");
}

void cameras(const fs::path& out) {
  const Corpus corpus(out, "camera_file");
  corpus.text("own",
              "image_width: 120\nimage_height: 90\ncamera_model: pinhole\n"
              "intrinsics: [100, 101.5, 60, 45]\ndistortion_model: radial-tangential\n"
              "distortion_coefficients: [-0.28, 0.07, 0.0002, 1e-05]\nrate_hz: 20\n"
              "camera_height: 1.65\n");
  corpus.text("euroc",
              "sensor_type: camera\ncomment: cam0\nT_BS:\n  cols: 4\n  rows: 4\n"
              "  data: [0, -1, 0, 0.02, 1, 0, 0, -0.06, 0, 0, 1, 0.01, 0, 0, 0, 1]\n"
              "rate_hz: 20\nresolution: [120, 90]\ncamera_model: pinhole\n"
              "intrinsics: [100, 100, 60, 45]\ndistortion_model: radial-tangential\n"
              "distortion_coefficients: [-0.28, 0.07, 0.0002, 1e-05]\n");
  corpus.text("kalibr",
              "cam0:\n  T_cam_imu:\n  - [1, 0, 0, 0.1]\n  - [0, 1, 0, 0]\n  - [0, 0, 1, 0]\n"
              "  - [0, 0, 0, 1]\n  camera_model: pinhole\n  distortion_coeffs: [0.01, 0, 0, 0]\n"
              "  distortion_model: equidistant\n  intrinsics: [100, 100, 60, 45]\n"
              "  resolution: [120, 90]\n  rostopic: /cam0\n");
  const std::string matrix = "  rows: 3\n  cols: 3\n  data: [100, 0, 60, 0, 100, 45, 0, 0, 1]\n";
  corpus.text("opencv",
              "%YAML:1.0\n---\nimage_width: 120\nimage_height: 90\ncamera_matrix: "
              "!!opencv-matrix\n" +
                  matrix +
                  "distortion_coefficients: !!opencv-matrix\n  rows: 1\n  cols: 5\n"
                  "  dt: d\n  data: [0.1, 0, 0, 0, 0]\n");
  corpus.text("ros",
              "image_width: 120\nimage_height: 90\ncamera_name: left\ncamera_matrix:\n" + matrix +
                  "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n"
                  "  data: [0.1, 0, 0, 0, 0]\n");
}

void recordings(const fs::path& out) {
  const Corpus corpus(out, "recording");
  corpus.text("euroc",
              "#timestamp [ns],filename\n1403636579763555584,1403636579763555584.png\r\n"
              "1403636579813555456,1403636579813555456.png\n");
  corpus.text("tum",
              "# color images\n1305031102.175304 rgb/1305031102.175304.png\n"
              "1305031102.211214 rgb/1305031102.211214.png\n");
}

void metrics(const fs::path& out) {
  const Corpus corpus(out, "metrics");
  stemvo::MetricsReport report;
  report.sequence = "03";
  report.model = "default";
  corpus.text("without_truth", stemvo::to_text(stemvo::metrics_document(report)));
  report.metrics = stemvo::Metrics{};
  report.metrics->segment_lengths_m = {100.0, 200.0};
  report.camera.sigma = {2.0, 0.5, 0.25};
  corpus.text("with_truth", stemvo::to_text(stemvo::metrics_document(report)));
}

void maps(const fs::path& out) {
  const Corpus corpus(out, "map_file");
  Corpus::done(stemvo::write_map_file(corpus / "small", stemvo::testing::small_map()));
  Corpus::done(stemvo::write_map_file(corpus / "empty", {}));
}

cv::Mat picture(int type, int rows, int cols) {
  cv::Mat image(rows, cols, type);
  cv::RNG(7).fill(image, cv::RNG::UNIFORM, 0, 255);
  for (int i = 0; i < cols / 2 * image.channels(); ++i) {
    image.row(rows / 2).data[i] = static_cast<unsigned char>(3 * i);
  }
  return image;
}

void configurations(const fs::path& out) {
  const Corpus configuration(out, "configuration");
  configuration.text("all", stemvo::dump_config({}));
  configuration.text("few",
                     "stem: {filter: 3, model: gray}\nevaluation:\n  segment_lengths_m: [1]\n");
  configuration.text("assignment", "evaluation.segment_lengths_m=[100, 200]");
}

void images(const fs::path& out) {
  const Corpus image(out, "image");
  for (const auto& [name, type] : {std::pair("gray", CV_8UC1), std::pair("color", CV_8UC3),
                                   std::pair("alpha", CV_8UC4), std::pair("deep", CV_16UC1)}) {
    cv::imwrite((image / fmt::format("{}.png", name)).string(), picture(type, 9, 13));
  }
  cv::imwrite((image / "one_bit.png").string(), picture(CV_8UC1, 5, 17),
              {cv::IMWRITE_PNG_BILEVEL, 1});
  cv::imwrite((image / "gray.jpg").string(), picture(CV_8UC1, 17, 20));
  cv::imwrite((image / "color.jpg").string(), picture(CV_8UC3, 17, 20));
  cv::imwrite((image / "progressive.jpg").string(), picture(CV_8UC3, 17, 20),
              {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
}

}  // namespace

int main(int num_arguments, char** arguments) {
  if (num_arguments != 2) {
    std::fprintf(stderr, "usage: make_corpora OUT\n");
    return 2;
  }
  const fs::path out = arguments[1];
  kitti(out);
  poses(out);
  cameras(out);
  recordings(out);
  metrics(out);
  maps(out);
  configurations(out);
  images(out);
  return 0;
}
