// SPDX-License-Identifier: MIT
#include "pipeline/checkpoint.hpp"

#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <libdeflate.h>

#include "odometry/state_archive.hpp"
#include "text/text_file.hpp"

namespace stemvo {

namespace html {
template <typename Archive>
void serialize(Archive& archive, CaptionedImage& image) {
  archive(image.caption, image.jpeg);
}
}  // namespace html

namespace pipeline {

template <typename Archive>
void serialize(Archive& archive, Drive& drive) {
  archive(drive.frames, drive.csv, drive.images, drive.warnings);
}

namespace {

/// The file's first line: a mark, and the CRC-32 of all behind it.
std::string first_line(std::string_view rest) {
  return fmt::format("stemvo checkpoint {:08x}\n", libdeflate_crc32(0, rest.data(), rest.size()));
}

}  // namespace

std::filesystem::path checkpoint_file(const std::filesystem::path& out_dir) {
  return out_dir / "checkpoint";
}

std::string pack(std::size_t frame,
                 const std::string& odometry,
                 const Drive& drive,
                 double elapsed_s,
                 const std::string& identity) {
  std::ostringstream bytes;
  bytes << first_line({});  // its room
  StateWriter writer(bytes);
  writer(identity, frame, odometry, drive, elapsed_s);
  std::string text = std::move(bytes).str();  // megabytes: never twice
  const std::size_t start = text.find('\n') + 1;
  return text.replace(0, start, first_line(std::string_view(text).substr(start)));
}

Error damaged_checkpoint(const std::filesystem::path& file, const std::string& why) {
  return fail(
      fmt::format("--resume: {}: expected a checkpoint, found damaged data{}; without "
                  "--resume the run starts over",
                  file.string(), why.empty() ? why : fmt::format(" ({})", why)));
}

Expected<std::optional<Checkpoint>> read_checkpoint(const std::filesystem::path& file,
                                                    const std::string& identity,
                                                    std::size_t num_frames) {
  std::error_code code;
  if (!std::filesystem::exists(file, code)) {
    return std::optional<Checkpoint>();
  }
  const auto text = read_text_file(file);
  if (!text) {
    return fail("--resume: " + text.error().message);
  }
  const std::string_view content = std::string_view(*text).substr(text->find('\n') + 1);
  if (!text->starts_with(first_line(content))) {
    return damaged_checkpoint(file);
  }
  try {  // what the sum does not tell, the reader does
    StateReader reader(content);
    std::string found;
    reader(found);
    if (found != identity) {
      return fail(
          fmt::format("--resume: {}: expected the checkpoint of this program, input and "
                      "configuration, found another one's; give another --out, or what it "
                      "was; without --resume the run starts over",
                      file.string()));
    }
    std::optional<Checkpoint> checkpoint(std::in_place);
    reader(checkpoint->frame, checkpoint->odometry, checkpoint->drive,
           checkpoint->drive.elapsed_before_s);
    StateReader::expect(reader.num_left() == 0 && checkpoint->frame < num_frames &&
                        checkpoint->frame == checkpoint->drive.frames.size());
    return checkpoint;
  } catch (const cereal::Exception&) {
    return damaged_checkpoint(file);
  }
}

}  // namespace pipeline
}  // namespace stemvo
