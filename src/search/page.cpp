// SPDX-License-Identifier: MIT
// report.html of a search.
#include "html/page.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "report/metrics_keys.hpp"
#include "search/records.hpp"

namespace stemvo::search {
namespace {

using Json = nlohmann::ordered_json;

Json row_json(const Results& results, const FilterRow& row) {
  const ErrorRatio& over = row.over_best;
  const bool has_held_out = row.held_out && row.held_out->detected;
  return {{"name", to_string(row.key)},
          {"is_baseline", results.identity.layer_of(row.key).baseline},
          {"is_stopped", row.status == FilterStatus::kStopped},
          {"is_equal", row.is_equal},
          {"t_rel", row.mean.t_rel_percent},
          {"r_rel", row.mean.r_rel_deg_per_100m},
          {"inliers", row.mean.inliers},
          {"tracked", row.mean.tracked},
          {"held_out_t_rel", has_held_out ? row.held_out->t_rel_percent : std::nullopt},
          {"over_best", {{"ratio", over.ratio}, {"low", over.low}, {"high", over.high}}}};
}

}  // namespace

Status write_page(const Results& results, const Pictures& pictures, const std::string& table) {
  const SearchIdentity& identity = results.identity;
  const ShownFilters shown = choose_rows(identity, results.rows);
  Json content = {{"page", "search"},
                  {"best", shown.empty() ? Json() : Json(to_string(shown.front().second->key))},
                  {"num_rows", results.rows.size()},
                  {"has_intervals", has_intervals(results.rows)},
                  {"is_exhaustive", identity.rungs.size() == 1},
                  {"sequences", Json::array()},
                  {"rows", Json::array()},
                  {"paths", Json::array()},
                  {"images", html::images_json(pictures.channels)},
                  {"table", table},
                  {"command", results.target.command},
                  {"configuration", identity.configuration}};
  for (const SequenceIdentity& sequence : identity.sequences) {
    content["sequences"].push_back({{"name", sequence.name},
                                    {"first", sequence.first_frame},
                                    {"end", sequence.end_frame()},
                                    {"held_out", sequence.held_out}});
  }
  for (const FilterRow& row : results.rows) {
    if (row.status != FilterStatus::kNotDetected) {
      content["rows"].push_back(row_json(results, row));
    }
  }
  if (pictures.ground_truth) {
    content["truth"] = html::path_json(*pictures.ground_truth);
    for (const auto& [rank, row] : shown) {
      content["paths"].push_back({{"name", fmt::format("{}: {}", rank, to_string(row->key))},
                                  {"is_baseline", identity.layer_of(row->key).baseline},
                                  {"xz", row->drives.front().path_xz_m}});
    }
  }
  return html::write_page(results.target.out_dir / "report.html", content);
}

}  // namespace stemvo::search
