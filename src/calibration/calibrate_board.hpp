// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "calibration/board.hpp"
#include "calibration/board_fit.hpp"
#include "calibration/calibrate.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// Everything `stemvo calibrate --board` was asked for.
struct BoardRequest {
  std::filesystem::path pictures;  ///< a folder, a pattern of images, a video
  std::filesystem::path out_file;  ///< camera.yaml
  Board board;
  std::string board_text;  ///< as it was given, for the file
};

/// The camera, and what it rests on.
struct BoardReport {
  BoardFit fit;
  std::vector<BoardView> views;      ///< that show the board
  std::size_t num_pictures = 0;      ///< that were looked at
  std::vector<std::string> missing;  ///< pictures to take next
  std::vector<std::string> warnings;
  std::filesystem::path coverage_file;  ///< beside out_file
  bool interrupted = false;             ///< no file is written
};

/// The camera by pictures of a printed board. Of a video views are taken that differ. Writes
/// out_file (with errors and sigmas as comments) and the picture of what is covered. Errors: no
/// pictures, under three with the board, files that cannot be written.
[[nodiscard]] Expected<BoardReport> calibrate_board(const BoardRequest& request,
                                                    const RunProgress& progress = {});

/// Numbers with their sigmas, views left out, pictures to take next.
[[nodiscard]] std::string format_board_table(const BoardReport& report);

}  // namespace stemvo
