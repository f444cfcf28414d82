// SPDX-License-Identifier: MIT
#pragma once

#include <sys/file.h>

#include "support/run_program.hpp"
#include "support/test.hpp"

namespace stemvo::test {

/// A rendered drive, made once per build of the program and shared by all tests, which are
/// processes of their own and may run at the same time.
struct DriveSize {
  int frames = 60;
  int width_px = 620;
  int height_px = 188;
};

inline std::string image_name(int frame) { return fmt::format("image_2/{:06}.png", frame); }

/// Empties the folder for rendered drives when the program is a new one. Hold its lock file.
inline void clear_old_drives(const fs::path& base) {
  const std::string built =
      std::to_string(fs::last_write_time(STEMVO_PROGRAM).time_since_epoch().count());
  if (read_file(base / "program") != built) {  // drives of an older program
    for (const auto& entry : fs::directory_iterator(base)) {
      if (entry.is_directory()) {
        fs::remove_all(entry.path());
      }
    }
    std::ofstream(base / "program") << built;
  }
}

/// Renders a drive by these options of `stemvo synth`, or takes the one that is there. Returns the
/// folder with sequences/00 and poses/00.txt. Read it only; copy what is to be broken.
inline fs::path render_once(const std::string& name, const Words& options) {
  const fs::path parent = fs::path(STEMVO_PROGRAM).parent_path() / "test_drives";
  fs::create_directories(parent);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> lock(
      std::fopen((parent / "lock").c_str(), "a"), &std::fclose);
  ::flock(::fileno(lock.get()), LOCK_EX);
  clear_old_drives(parent);
  const fs::path drive = parent / name;
  if (!fs::exists(drive)) {
    const fs::path unfinished = parent / (name + ".unfinished");
    fs::remove_all(unfinished);
    succeeded(run_stemvo({"synth", unfinished.string()}, options));
    fs::rename(unfinished, drive);
  }
  return drive;
}

inline fs::path render_once(const std::string& name,
                            const DriveSize& size,
                            const std::optional<fs::path>& poses) {
  const Words along = poses ? Words{"--trajectory", poses->string()} : Words();
  return render_once(
      name, joined({"--frames", std::to_string(size.frames), "--width",
                    std::to_string(size.width_px), "--height", std::to_string(size.height_px)},
                   along));
}

/// A walk with the camera in the hand, 640 x 480, 30 frames a second.
inline fs::path render_walk_once(int num_frames) {
  return render_once("walk_" + std::to_string(num_frames),
                     {"--walk", "--frames", std::to_string(num_frames)});
}

inline fs::path rendered_drive(const DriveSize& size = {}) {
  return render_once(std::to_string(size.frames) + "x" + std::to_string(size.width_px) + "x" +
                         std::to_string(size.height_px),
                     size, std::nullopt);
}

/// The first frames of the rendered drive, copied, to be broken.
inline fs::path copy_drive(const fs::path& to, int num_frames) {
  const fs::path from = rendered_drive();
  const fs::path sequence = to / "sequences" / "00";
  fs::create_directories(sequence / "image_2");
  fs::create_directories(to / "poses");
  fs::copy_file(from / "poses/00.txt", to / "poses/00.txt");
  for (const char* name : {"calib.txt", "times.txt"}) {
    fs::copy_file(from / "sequences/00" / name, sequence / name);
  }
  for (int i = 0; i < num_frames; ++i) {
    fs::copy_file(from / "sequences/00" / image_name(i), sequence / image_name(i));
  }
  return sequence;
}

}  // namespace stemvo::test
