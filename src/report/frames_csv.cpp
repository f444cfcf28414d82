// SPDX-License-Identifier: MIT
#include "report/frames_csv.hpp"

#include <cerrno>
#include <system_error>
#include <utility>

#include <fmt/format.h>

namespace stemvo {

namespace {

constexpr std::string_view kHeader =
    "frame,timestamp_s,state,matches,inliers,s_h,s_f,r_h,model,stem_ms,features_ms,pose_ms,"
    "scale_sigma,road\n";

constexpr std::string_view kModels[] = {"none", "homography", "essential"};  // by TwoViewModel

}  // namespace

void FramesCsv::put(std::string_view text) {
  if (!failure_.empty()) {
    return;
  }
  errno = 0;
  stream_.write(text.data(), static_cast<std::streamsize>(text.size()));
  stream_.flush();  // a killed run keeps its rows
  if (!stream_) {
    failure_ = std::generic_category().message(errno);
  }
}

Status FramesCsv::status() const {
  return failure_.empty() ? Status()
                          : fail(fmt::format("{}: cannot write: {}", file_.string(), failure_));
}

Expected<FramesCsv> FramesCsv::create(const std::filesystem::path& file) {
  FramesCsv csv;
  csv.file_ = file;
  errno = 0;
  csv.stream_.open(file, std::ios::binary | std::ios::trunc);
  if (!csv.stream_) {
    csv.failure_ = std::generic_category().message(errno);
  }
  csv.put(kHeader);
  if (const Status created = csv.status(); !created) {
    return created.error();
  }
  return csv;
}

void FramesCsv::write(std::size_t frame, double timestamp_s, const FrameResult& r) {
  const std::string sigma = r.scale_sigma ? fmt::format("{:.4f}", *r.scale_sigma) : "";
  put(fmt::format("{},{},{},{},{},{:.3f},{:.3f},{:.4f},{},{:.3f},{:.3f},{:.3f},{},{}\n", frame,
                  timestamp_s, to_string(r.state), r.num_matches, r.num_inliers, r.homography_score,
                  r.fundamental_score, r.homography_ratio,
                  kModels[static_cast<std::size_t>(r.model)], r.times.stem_ms, r.times.features_ms,
                  r.times.pose_ms, sigma, to_string(r.road)));
}

Status FramesCsv::close() {
  stream_.close();
  if (failure_.empty() && !stream_) {
    failure_ = std::generic_category().message(errno);
  }
  return status();
}

}  // namespace stemvo
