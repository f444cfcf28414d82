// SPDX-License-Identifier: MIT
// The lists of images of EuRoC's and TUM's recordings.
#include <fstream>

#include "dataset/listing.hpp"
#include "fuzz_input.hpp"

namespace {

namespace fs = std::filesystem;

/// A recording of each kind, whose lists are links to the input.
class Recordings {
 public:
  Recordings() : root_(fs::temp_directory_path() / ("stemvo_fuzz_" + std::to_string(::getpid()))) {
    fs::create_directories(root_ / "euroc/cam0/data");
    fs::create_directories(root_ / "tum");
    std::ofstream(root_ / "euroc/cam0/sensor.yaml") << "rate_hz: 20\n";
  }
  Recordings(const Recordings&) = delete;
  Recordings& operator=(const Recordings&) = delete;
  ~Recordings() {
    std::error_code ignored;
    fs::remove_all(root_, ignored);
  }

  void check(const fs::path& input) const {
    list(input, root_ / "euroc", "cam0/data.csv");
    list(input, root_ / "tum", "rgb.txt");
  }

 private:
  static void list(const fs::path& input, const fs::path& folder, const char* name) {
    fs::remove(folder / name);
    fs::create_symlink(input, folder / name);
    const auto found = stemvo::dataset::find_listing(folder);
    stemvo::fuzz::expect(found.has_value(), "a recording is known by its files");
    const auto& listing = *found;
    stemvo::fuzz::expect_said(listing);
    stemvo::fuzz::expect(
        !listing || (!listing->files.empty() && listing->files.size() == listing->times_s.size()),
        "a time for each image");
  }

  fs::path root_;
};

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Recordings recordings;
  const stemvo::fuzz::InputFile file(data, size);
  recordings.check(file.path());
  return 0;
}
