// SPDX-License-Identifier: MIT
#include "stemvo/report/frames_csv.hpp"

#include <cerrno>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/core.h>

namespace stemvo {

namespace {

constexpr std::string_view kHeader =
    "frame,timestamp_s,state,matches,inliers,s_h,s_f,r_h,model,stem_ms,features_ms,pose_ms,"
    "scale_sigma,road\n";

std::string_view model_name(TwoViewModel model) {
  switch (model) {
    case TwoViewModel::kNone:
      return "none";
    case TwoViewModel::kHomography:
      return "homography";
    case TwoViewModel::kEssential:
      return "essential";
  }
  return "unknown";
}

}  // namespace

struct FramesCsv::Impl {
  std::filesystem::path file;
  std::ofstream stream;
  std::string trouble;  ///< the first failed write

  void put(std::string_view text) {
    if (!trouble.empty()) {
      return;
    }
    errno = 0;
    stream.write(text.data(), static_cast<std::streamsize>(text.size()));
    stream.flush();  // a killed run keeps its rows
    if (!stream) {
      trouble = std::generic_category().message(errno);
    }
  }
};

FramesCsv::FramesCsv(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
FramesCsv::FramesCsv(FramesCsv&&) noexcept = default;
FramesCsv& FramesCsv::operator=(FramesCsv&&) noexcept = default;
FramesCsv::~FramesCsv() = default;

Expected<FramesCsv> FramesCsv::create(const std::filesystem::path& file) {
  auto impl = std::make_unique<Impl>();
  impl->file = file;
  errno = 0;
  impl->stream.open(file, std::ios::binary | std::ios::trunc);
  if (!impl->stream) {
    return fail(
        fmt::format("{}: cannot write: {}", file.string(), std::generic_category().message(errno)));
  }
  FramesCsv csv(std::move(impl));
  csv.impl_->put(kHeader);
  if (!csv.impl_->trouble.empty()) {
    return fail(fmt::format("{}: cannot write: {}", file.string(), csv.impl_->trouble));
  }
  return csv;
}

void FramesCsv::write(std::size_t frame, double timestamp_s, const FrameResult& r) {
  const std::string sigma = r.scale_sigma ? fmt::format("{:.4f}", *r.scale_sigma) : "";
  impl_->put(fmt::format("{},{},{},{},{},{:.3f},{:.3f},{:.4f},{},{:.3f},{:.3f},{:.3f},{},{}\n",
                         frame, timestamp_s, to_string(r.state), r.num_matches, r.num_inliers,
                         r.homography_score, r.fundamental_score, r.homography_ratio,
                         model_name(r.model), r.times.stem_ms, r.times.features_ms, r.times.pose_ms,
                         sigma, to_string(r.road)));
}

Status FramesCsv::close() {
  impl_->stream.close();
  if (impl_->trouble.empty() && !impl_->stream) {
    impl_->trouble = std::generic_category().message(errno);
  }
  if (!impl_->trouble.empty()) {
    return fail(fmt::format("{}: cannot write: {}", impl_->file.string(), impl_->trouble));
  }
  return {};
}

}  // namespace stemvo
