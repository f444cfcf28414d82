// SPDX-License-Identifier: MIT
#include <algorithm>
#include <functional>
#include <vector>

#include <fmt/format.h>

#include "search/ranking.hpp"
#include "search/tables.hpp"

namespace stemvo::search {
namespace {

/// RFC 4180: quoted where it must be.
std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) {
    return text;
  }
  std::string quoted = "\"";
  for (const char c : text) {
    quoted.append(c == '"' ? 2 : 1, c);
  }
  quoted += '"';
  return quoted;
}

std::string number(const std::optional<double>& value, int decimals = 4) {
  return value ? fmt::format("{:.{}f}", *value, decimals) : std::string();
}

/// A column: its name and what a row has there.
struct Column {
  std::string name;
  std::function<std::string(const FilterRow&, const MeanScore&)> cell;
};

/// `value` of MeanScore, of that many decimals.
template <typename Value>
Column mean_column(const char* name, Value MeanScore::* value, int decimals = 4) {
  return {name, [value, decimals](const FilterRow&, const MeanScore& mean) {
            return number(mean.*value, decimals);
          }};
}

/// `value` of a drive; nothing where there is none, or its pose was not detected.
template <typename Value>
std::string held_out_cell(const FilterRow& row, Value DriveScore::* value) {
  return row.held_out && row.held_out->is_detected ? number((*row.held_out).*value) : "";
}

void add_sequences(const SearchIdentity& identity, std::vector<Column>& columns) {
  std::vector<std::string> ranking;
  for (const SequenceIdentity& sequence : identity.sequences) {
    if (!sequence.is_held_out) {
      ranking.push_back(sequence.name);
    }
  }
  for (std::size_t i = 0; ranking.size() > 1 && i < ranking.size(); ++i) {
    columns.push_back({"t_rel_percent_" + ranking[i], [i](const FilterRow& row, const MeanScore&) {
                         return number(row.drives[i].t_rel_percent);
                       }});
    columns.push_back(
        {"r_rel_deg_per_100m_" + ranking[i], [i](const FilterRow& row, const MeanScore&) {
           return number(row.drives[i].r_rel_deg_per_100m);
         }});
  }
}

void add_held_out(const SearchIdentity& identity, std::vector<Column>& columns) {
  if (std::none_of(identity.sequences.begin(), identity.sequences.end(),
                   [](const SequenceIdentity& sequence) { return sequence.is_held_out; })) {
    return;
  }
  columns.push_back({"held_out_t_rel_percent", [](const FilterRow& row, const MeanScore&) {
                       return held_out_cell(row, &DriveScore::t_rel_percent);
                     }});
  columns.push_back({"held_out_r_rel_deg_per_100m", [](const FilterRow& row, const MeanScore&) {
                       return held_out_cell(row, &DriveScore::r_rel_deg_per_100m);
                     }});
  columns.push_back({"held_out_average_offset_m", [](const FilterRow& row, const MeanScore&) {
                       return held_out_cell(row, &DriveScore::average_offset_m);
                     }});
}

std::vector<Column> columns_of(const SearchIdentity& identity) {
  std::vector<Column> columns = {
      {"model", [](const FilterRow& row, const MeanScore&) { return row.key.model; }},
      {"layer", [](const FilterRow& row, const MeanScore&) { return row.key.layer; }},
      {"filter",
       [](const FilterRow& row, const MeanScore&) { return std::to_string(row.key.filter); }},
      {"features", [](const FilterRow& row, const MeanScore&) { return row.key.features; }},
      {"status",
       [](const FilterRow& row, const MeanScore&) { return std::string(to_string(row.status)); }},
      mean_column("t_rel_percent", &MeanScore::t_rel_percent),
      mean_column("r_rel_deg_per_100m", &MeanScore::r_rel_deg_per_100m),
      mean_column("average_offset_m", &MeanScore::average_offset_m),
      mean_column("E_t_m", &MeanScore::translation_change_m),
      mean_column("E_r_deg", &MeanScore::rotation_change_deg),
      mean_column("inliers", &MeanScore::mean_inliers, 1),
      mean_column("tracked", &MeanScore::tracked_fraction),
      {"frames",
       [](const FilterRow&, const MeanScore& mean) { return std::to_string(mean.num_frames); }}};
  add_sequences(identity, columns);
  add_held_out(identity, columns);
  columns.push_back(
      {"reason", [](const FilterRow& row, const MeanScore&) { return reason_of(row); }});
  return columns;
}

}  // namespace

std::string format_csv(const SearchIdentity& identity, const SearchReport& report) {
  const std::vector<Column> columns = columns_of(identity);
  std::string text;
  const auto add_line = [&](const auto& cell_of) {
    for (std::size_t i = 0; i < columns.size(); ++i) {
      text += i > 0 ? "," : "";
      text += csv_cell(cell_of(columns[i]));
    }
    text += '\n';
  };
  add_line([](const Column& column) { return column.name; });
  for (const FilterRow& row : report.rows) {
    const MeanScore mean = mean_score(row.drives);
    add_line([&](const Column& column) { return column.cell(row, mean); });
  }
  return text;
}

}  // namespace stemvo::search
