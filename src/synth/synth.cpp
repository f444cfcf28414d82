// SPDX-License-Identifier: MIT
#include "synth/synth.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "internal_check.hpp"
#include "io/png.hpp"
#include "pipeline/out_folder.hpp"
#include "stem/model_file.hpp"
#include "synth/renderer.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

/// Says in a folder that it holds nothing but what was rendered, which is this; in it the hashes of
/// the texts, which a user may have edited.
constexpr std::string_view kMark = "rendered_by_stemvo";
constexpr std::string_view kPoses = "poses.txt";
constexpr std::array<std::string_view, 4> kTexts = {"calib.txt", "times.txt", "camera.yaml",
                                                    kPoses};
constexpr std::array<std::string_view, 6> kContents = {"image_2",   "depth",       "calib.txt",
                                                       "times.txt", "camera.yaml", "poses.txt"};

Error cannot(const char* what, const fs::path& path, const std::error_code& code) {
  return fail(fmt::format("{}: cannot {}: {}", path.string(), what, code.message()));
}

/// All that is in the folder, if it is there, has such a name.
template <typename Predicate>
bool holds_only(const fs::path& folder, const Predicate& is_ours) {
  std::error_code code;
  const bool is_only =
      std::all_of(fs::directory_iterator(folder, code), fs::directory_iterator(),
                  [&](const auto& entry) { return is_ours(entry.path().filename()); });
  return is_only && (!code || code == std::errc::no_such_file_or_directory);
}

/// A user may have put results or masks beside it, or notes among the frames.
bool holds_only_a_drive(const fs::path& folder) {
  const auto final_name = [](const fs::path& name) {  // a kill may have left one unfinished
    return name.extension() == ".unfinished" ? name.stem() : name;
  };
  const auto is_frame = [&](const fs::path& name) {
    const fs::path frame = final_name(name);
    const std::string number = frame.stem().string();
    return (frame.extension() == ".png" || frame.extension() == ".npy") && number.size() == 6 &&
           number.find_first_not_of("0123456789") == number.npos;
  };
  const auto is_content = [&](const fs::path& name) {
    const std::string content = final_name(name).string();
    return content == kMark || std::ranges::find(kContents, content) != kContents.end();
  };
  return holds_only(folder, is_content) && holds_only(folder / "image_2", is_frame) &&
         holds_only(folder / "depth", is_frame);
}

/// OUT/sequences/NAME and OUT/poses in KITTI's layout. Everything is made beside them, and takes
/// their names when it is whole. Every Error names the file.
struct Output {
  fs::path sequence_dir;  ///< while it is made, with the poses in it: NAME.unfinished

  Output(const fs::path& out_dir, const std::string& name)
      : sequence_dir(out_dir / "sequences" / (name + ".unfinished")),
        final_dir_(out_dir / "sequences" / name),
        final_poses_(out_dir / "poses" / (name + ".txt")) {}

  /// Makes the folders, for one process at a time. Error: what is there was not rendered.
  [[nodiscard]] Expected<pipeline::FolderLock> prepare(bool with_depth) const {
    if (const Status status = check_final_names(); !status) {
      return status.error();
    }
    std::error_code code;
    fs::create_directories(sequence_dir, code);
    if (code) {
      return cannot("create the folder", sequence_dir, code);
    }
    auto lock = pipeline::lock_folder(sequence_dir);
    const Status status = lock ? make_folders(with_depth) : Status(lock.error());
    return status ? std::move(lock) : status.error();
  }

  /// Error: something there was not rendered.
  [[nodiscard]] Status check_final_names() const {
    std::error_code code;
    // Killed in finish(), only the unfinished folder says whose the poses are.
    const bool is_ours =
        has_earlier() ? holds_only_a_drive(final_dir_)
                      : fs::exists(sequence_dir / kMark, code) && !fs::exists(final_dir_, code);
    for (const fs::path& path : {final_dir_, final_poses_}) {
      const bool is_empty = fs::is_directory(path, code) && fs::is_empty(path, code);
      if (!is_ours && fs::exists(path, code) && !is_empty) {
        return fail(
            fmt::format("{}: expected a drive that stemvo rendered, which a new one may replace, "
                        "or none, found something else (--name gives another name)",
                        path.string()));
      }
    }
    return check_texts();
  }

  /// Error: one was edited.
  [[nodiscard]] Status check_texts() const {
    const std::string mark = read_text_file(final_dir_ / kMark).value_or("");
    for (std::string_view line : split_lines(mark)) {
      const std::string_view hash = take_word(line);
      const std::string_view name = take_word(line);
      const fs::path file = name == kPoses ? final_poses_ : final_dir_ / name;
      const auto text = read_text_file(file);
      if (text && internal::sha256_hex(*text) != hash) {
        return fail(
            fmt::format("{}: expected it as stemvo rendered it, so that a new drive may replace "
                        "it, found it changed (--name gives another name)",
                        file.string()));
      }
    }
    return {};
  }

  [[nodiscard]] Status mark_texts() const {
    std::string mark;
    for (const std::string_view name : kTexts) {
      if (const auto text = read_text_file(sequence_dir / name)) {
        mark += fmt::format("{} {}\n", internal::sha256_hex(*text), name);
      }
    }
    return write_text_file(sequence_dir / kMark, mark);
  }

  /// In place of an unfinished drive.
  [[nodiscard]] Status make_folders(bool with_depth) const {
    std::error_code code;
    const bool is_empty = fs::is_empty(sequence_dir, code);
    if (code) {
      return cannot("list the folder", sequence_dir, code);
    }
    const bool is_ours = fs::exists(sequence_dir / kMark, code) && holds_only_a_drive(sequence_dir);
    if (!is_ours && !is_empty) {
      return fail(fmt::format("{}: expected an unfinished drive or none, found something else",
                              sequence_dir.string()));
    }
    for (const std::string_view name : kContents) {
      fs::remove_all(sequence_dir / name, code);
      if (code) {
        return cannot("remove the unfinished drive", sequence_dir, code);
      }
    }
    for (const fs::path& folder :
         {sequence_dir / "image_2", final_poses_.parent_path(), sequence_dir / "depth"}) {
      if (with_depth || folder.filename() != "depth") {
        if (const Status made = pipeline::create_out_folder(folder); !made) {
          return made;
        }
      }
    }
    return write_text_file(sequence_dir / kMark, "");
  }

  [[nodiscard]] bool has_earlier() const {
    std::error_code code;
    return fs::exists(final_dir_ / kMark, code);
  }

  /// Leaves an earlier drive as it is.
  [[nodiscard]] Status abandon() const {
    std::error_code code;
    fs::remove_all(sequence_dir, code);
    return code ? Status(cannot("remove the unfinished drive", sequence_dir, code)) : Status();
  }

  /// In place of an earlier drive.
  [[nodiscard]] Status finish() const {
    if (Status status = mark_texts(); !status) {
      return status;
    }
    std::error_code code;
    fs::remove_all(final_dir_, code);
    if (!code) {
      fs::rename(sequence_dir / kPoses, final_poses_, code);
    }
    if (!code) {
      fs::rename(sequence_dir, final_dir_, code);
    }
    return code ? Status(cannot("replace the drive", final_dir_, code)) : Status();
  }

  /// image_2/%06d.png. May be called from several threads for different frames.
  [[nodiscard]] Status write_image(std::size_t index, const cv::Mat& rgb) const {
    const fs::path file = sequence_dir / "image_2" / fmt::format("{:06}.png", index);
    // Noise does not compress: the fastest level costs a few per cent of size.
    return write_text_file(file, io::encode_png(rgb, true));
  }

  /// depth/%06d.npy: NumPy format 1.0, little-endian float32, rows first; metres along z.
  [[nodiscard]] Status write_depth(std::size_t index, const cv::Mat& depth_m) const {
    static_assert(std::endian::native == std::endian::little, "the header says '<f4'");
    STEMVO_CHECK(depth_m.type() == CV_32FC1 && depth_m.isContinuous(), "depth is one float plane");
    const std::string header =
        fmt::format("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}", depth_m.rows,
                    depth_m.cols);
    // Magic, version and the length of the header, which fills 128 bytes with them and a newline.
    std::string bytes("\x93NUMPY\x01\x00\x76\x00", 10);
    bytes += fmt::format("{:117}\n", header);
    bytes.append(reinterpret_cast<const char*>(depth_m.data), depth_m.total() * sizeof(float));
    return write_text_file(sequence_dir / "depth" / fmt::format("{:06}.npy", index), bytes);
  }

  /// calib.txt with the same intrinsics in P0 to P3, no baseline.
  [[nodiscard]] Status write_calibration(const Camera& camera) const {
    std::string text;
    for (int i = 0; i < 4; ++i) {
      text += fmt::format("P{}: {:.12e} 0 {:.12e} 0 0 {:.12e} {:.12e} 0 0 0 1 0\n", i, camera.fx_px,
                          camera.cx_px, camera.fy_px, camera.cy_px);
    }
    return write_text_file(sequence_dir / "calib.txt", text);
  }

  /// camera.yaml beside calib.txt, for sources that read a folder of images.
  [[nodiscard]] Status write_camera_file(const Camera& camera, double rate_hz) const {
    return write_text_file(
        sequence_dir / "camera.yaml",
        fmt::format("image_width: {}\nimage_height: {}\ncamera_model: pinhole\n"
                    "intrinsics: [{}, {}, {}, {}]\n"
                    "distortion_model: none\ndistortion_coefficients: []\nrate_hz: {}\n",
                    camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px,
                    camera.cy_px, rate_hz));
  }

  /// times.txt and the poses, moved so that the first pose is the identity; 17 digits.
  [[nodiscard]] Status write_truth(std::span<const Rigid3> world_from_camera,
                                   double rate_hz) const {
    const int digits = rate_hz == 10.0 ? 6 : 12;  // KITTI's own number of digits where it is exact
    std::string times;
    std::string poses;
    for (std::size_t i = 0; i < world_from_camera.size(); ++i) {
      times += fmt::format("{:.{}e}\n", static_cast<double>(i) / rate_hz, digits);
      const Matrix34d m =
          i == 0 ? Rigid3().matrix()
                 : (world_from_camera.front().inverse() * world_from_camera[i]).matrix();
      for (int k = 0; k < 12; ++k) {
        poses += fmt::format("{:.16e}{}", m(k / 4, k % 4), k == 11 ? '\n' : ' ');
      }
    }
    return write_text_file(sequence_dir / "times.txt", times).and_then([&] {
      return write_text_file(sequence_dir / kPoses, poses);
    });
  }

 private:
  fs::path final_dir_;
  fs::path final_poses_;
};

/// What the options leave open is set here.
struct Settings {
  synth::Pace pace;
  Camera camera;
};

Settings settings_of(const SyntheticDriveOptions& options) {
  const int width_px = options.width_px.value_or(options.walk ? 640 : 1241);
  const int height_px = options.height_px.value_or(options.walk ? 480 : 376);
  if (options.walk) {
    const double f_px = 585.0 * width_px / 640.0;
    return {{options.rate_hz.value_or(30.0), options.speed_m_s},
            {f_px, f_px, 0.5 * width_px, 0.5 * height_px, width_px, height_px}};
  }
  // The left colour camera of sequence 00, scaled to the image's width.
  const double scale = width_px / 1241.0;
  const double f_px = 718.856 * scale;
  return {{options.rate_hz.value_or(10.0), options.speed_m_s},
          {f_px, f_px, 607.1928 * scale, 185.2157 * height_px / 376.0, width_px, height_px}};
}

Expected<std::variant<synth::Drive, synth::Walk>> plan_path(const SyntheticDriveOptions& options,
                                                            const synth::Pace& pace) {
  if (options.walk) {
    return synth::make_walk(options.num_frames, options.seed, pace);
  }
  if (!options.trajectory) {
    return synth::make_own_drive(options.num_frames, options.seed, pace);
  }
  auto poses = read_kitti_trajectory(*options.trajectory);
  if (!poses) {
    return poses.error();
  }
  poses->resize(std::min(poses->size(), static_cast<std::size_t>(options.num_frames)));
  return synth::make_drive_along(*poses, pace.rate_hz);
}

/// Frames [begin, end), at once.
Status render_frames(const synth::Renderer& renderer,
                     const Output& output,
                     cv::Range frames,
                     bool with_depth) {
  std::vector<Status> results(static_cast<std::size_t>(frames.size()));
  cv::parallel_for_(frames, [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) {
      const auto index = static_cast<std::size_t>(i);
      const synth::RenderedFrame frame = renderer.render(index);
      const Status written = output.write_image(index, frame.rgb);
      results[static_cast<std::size_t>(i - frames.start)] =
          written && with_depth ? output.write_depth(index, frame.depth_m) : written;
    }
  });
  const auto failed = std::ranges::find(results, false, &Status::has_value);
  return failed == results.end() ? Status() : *failed;
}

}  // namespace

Status check_options(const SyntheticDriveOptions& options) {
  if (options.trajectory && options.walk) {
    return fail("synth: expected a trajectory or a walk, found both");
  }
  if (options.trajectory && options.speed_m_s) {
    return fail("synth: expected a trajectory or a speed, found both (the poses say how fast)");
  }
  struct Limits {
    const char* name;
    double value;
    double low;
    double high;
  };
  const auto& [pace, camera] = settings_of(options);
  const double max_m_s = options.walk ? 1.0 : 60.0;  // faster, a turn on the spot would be a jerk
  for (const auto& [name, value, low, high] :
       {Limits{"width", 1.0 * camera.width_px, 16.0, 8192.0},
        Limits{"height", 1.0 * camera.height_px, 16.0, 8192.0},
        Limits{"frames", 1.0 * options.num_frames, 1.0, 1e6},  // %06d
        Limits{"rate", pace.rate_hz, 1.0, 1000.0},
        Limits{"speed", pace.speed_m_s.value_or(max_m_s), 0.1, max_m_s}}) {
    if (!(value >= low && value <= high)) {
      return fail(
          fmt::format("synth: expected {} from {} to {}, found {}", name, low, high, value));
    }
  }
  constexpr double kMaxWay_m = 2e6;  // a street's knots are kept in memory
  const double way_m = pace.speed_m_s.value_or(1.0) / pace.rate_hz * options.num_frames;
  if (way_m > kMaxWay_m) {
    return fail(
        fmt::format("synth: expected a way of at most {} km (frames / rate * speed), "
                    "found {:.0f}",
                    kMaxWay_m / 1000.0, way_m / 1000.0));
  }
  return {};
}

Status render_synthetic_drive(const std::filesystem::path& out_dir,
                              const SyntheticDriveOptions& options,
                              const RenderProgress& progress) {
  const Settings settings = settings_of(options);
  const auto& [pace, camera] = settings;
  if (const Status valid = check_options(options); !valid) {
    return valid;
  }
  auto path = plan_path(options, pace);
  if (!path) {
    return path.error();
  }
  const Output output(out_dir, options.name);
  const auto lock = output.prepare(options.write_depth);
  Status status = lock ? output.write_calibration(camera) : Status(lock.error());
  if (status && options.walk) {
    status = output.write_camera_file(camera, pace.rate_hz);
  }
  if (!status) {
    return status;
  }
  const synth::Renderer renderer(std::move(*path), camera, options.seed);
  const Trajectory& poses = renderer.world_from_camera();
  const int total = static_cast<int>(poses.size());
  const int batch = std::max(1, cv::getNumThreads());  // frames at once: bounds the memory
  int done = 0;
  for (bool go_on = true; go_on && done < total;) {
    const cv::Range frames(done, std::min(done + batch, total));
    status = render_frames(renderer, output, frames, options.write_depth);
    if (!status) {
      return status;
    }
    done = frames.end;
    go_on = !progress || progress(static_cast<std::size_t>(done), poses.size());
  }
  if (done < total && output.has_earlier()) {
    return output.abandon();
  }
  const auto rendered = std::span(poses).first(static_cast<std::size_t>(done));
  status = output.write_truth(rendered, pace.rate_hz);
  return status ? output.finish() : status;
}

}  // namespace stemvo
