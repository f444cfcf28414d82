// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "search/identity.hpp"
#include "stemvo/search/search.hpp"

namespace stemvo::search {

/// What one filter did on one rung.
struct Record {
  FilterKey key;
  int rung = 0;
  std::vector<DriveScore> drives;  ///< of the sequences that rank
  std::optional<DriveScore> held_out;
  std::size_t filter_frames = 0;  ///< that this took, with what a kill made it repeat
  std::size_t held_out_filter_frames = 0;
};

/// records.jsonl: the identity of the search in the first line, then one record a line.
struct RecordFileContent {
  SearchIdentity identity;
  std::vector<Record> records;
  std::uintmax_t num_good_bytes = 0;  ///< up to the last whole line; a kill may tear the next
};

/// Reads all whole lines. Errors: not there, a whole line that is no record, another format.
[[nodiscard]] Expected<RecordFileContent> read_records(const std::filesystem::path& file);

/// Appends records, so that what append() returned for is on the disk. One at a time: a second one
/// for the same file is an error.
class RecordWriter {
 public:
  /// A new file with the identity in it. Error: there is one already, or it cannot be written.
  [[nodiscard]] static Expected<RecordWriter> create(const std::filesystem::path& file,
                                                     const SearchIdentity& identity);
  /// Goes on behind the whole lines of a file; what a kill tore is cut off.
  [[nodiscard]] static Expected<RecordWriter> go_on(const std::filesystem::path& file,
                                                    std::uintmax_t num_good_bytes);
  [[nodiscard]] Status append(std::span<const Record> records);

 private:
  struct Descriptor;
  RecordWriter(std::filesystem::path file, std::shared_ptr<const Descriptor> descriptor);
  [[nodiscard]] Status write(const std::string& text);

  std::filesystem::path file_;
  std::shared_ptr<const Descriptor> descriptor_;
};

}  // namespace stemvo::search
