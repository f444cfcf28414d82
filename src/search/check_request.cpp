// SPDX-License-Identifier: MIT
#include "search/check_request.hpp"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include <fmt/format.h>

namespace stemvo::search {
namespace {

namespace fs = std::filesystem;

bool same_folder(const SequenceIdentity& a, const SequenceIdentity& b) {
  std::error_code code;
  return a.directory == b.directory || fs::equivalent(a.directory, b.directory, code);
}

Status check_pair(const SequenceIdentity& a, const SequenceIdentity& b) {
  if (same_folder(a, b)) {
    return fail(fmt::format("SEQUENCE_DIR: expected each folder once, found {} and {}", a.directory,
                            b.directory));
  }
  if (a.name == b.name) {
    return fail(fmt::format(
        "SEQUENCE_DIR: expected names by which sequences can be told apart, found two of the name "
        "{}: {} and {}",
        a.name, a.directory, b.directory));
  }
  return {};
}

Status check_held_out(const SequenceIdentity& held_out, const SequenceIdentity& ranking) {
  const std::size_t begin = std::max(held_out.first_frame, ranking.first_frame);
  const std::size_t end = std::min(held_out.first_frame + held_out.num_frames,
                                   ranking.first_frame + ranking.num_frames);
  if (begin < end && same_folder(held_out, ranking)) {
    return fail(
        fmt::format("--held-out: {}: expected frames that do not rank, found {}:{}, of which {}:{} "
                    "do (--held-out-frames, --frames)",
                    held_out.directory, held_out.first_frame,
                    held_out.first_frame + held_out.num_frames, begin, end));
  }
  return {};
}

}  // namespace

Status check_request(const SearchRequest& request) {
  if (const Status valid = validate(request.config); !valid) {
    return valid;
  }
  if (request.config.scale.source != "ground_truth") {
    return fail(fmt::format(
        "scale.source: expected ground_truth for a search, which ranks by t_rel with steps of the "
        "true length, found {}",
        request.config.scale.source));
  }
  const std::size_t num_sequences = request.sequence_dirs.size() + (request.held_out_dir ? 1 : 0);
  if (request.only_sequence && *request.only_sequence >= num_sequences) {
    return fail(fmt::format("--only-sequence: expected 0 to {}, the held-out one last, found {}",
                            num_sequences - 1, *request.only_sequence));
  }
  if (request.only_sequence && !request.exhaustive) {
    return fail(
        "--only-sequence: expected --exhaustive with it (halving goes by the mean over all "
        "sequences), found none");
  }
  for (auto layer = request.layers.begin(); layer != request.layers.end(); ++layer) {
    if (std::find(request.layers.begin(), layer, *layer) != layer) {
      return fail(fmt::format("--layers: expected each once, found '{}' again", *layer));
    }
  }
  return {};
}

Status check_sequences(const SearchIdentity& identity) {
  const auto& all = identity.sequences;
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const Status status =
          all[i].is_held_out ? check_held_out(all[i], all[j]) : check_pair(all[j], all[i]);
      if (!status) {
        return status;
      }
    }
  }
  return {};
}

}  // namespace stemvo::search
