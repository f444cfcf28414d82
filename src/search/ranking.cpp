// SPDX-License-Identifier: MIT
#include "search/ranking.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include <fmt/format.h>

namespace stemvo {

bool operator==(const FilterKey& a, const FilterKey& b) {
  return a.model == b.model && a.layer == b.layer && a.filter == b.filter &&
         a.features == b.features;
}

std::string to_string(const FilterKey& key) {
  return fmt::format("{} {} {}{}", key.model, key.layer, key.filter,
                     key.features == "klt" ? "" : " " + key.features);
}

std::string_view to_string(FilterStatus status) {
  switch (status) {
    case FilterStatus::kRanked:
      return "ranked";
    case FilterStatus::kStopped:
      return "stopped";
    default:
      return "not detected";
  }
}

}  // namespace stemvo

namespace stemvo::search {
namespace {

constexpr double kWorst = std::numeric_limits<double>::infinity();
/// Early on filters differ by less than chance; then more inliers are better: 10 % more weigh like
/// 0.5 % of error (docs/search.md).
constexpr double kInlierPower = 0.05;

/// What unfinished filters are compared by.
double early_error(const MeanScore& mean) {
  const double inliers = std::max(1.0, mean.mean_inliers.value_or(1.0));
  return mean.early_error_percent.value_or(kWorst) * std::pow(inliers, -kInlierPower);
}

bool all_detected(const std::vector<DriveScore>& drives) {
  return std::all_of(drives.begin(), drives.end(),
                     [](const DriveScore& drive) { return drive.is_detected; });
}

FilterRow row_of(const Record& record, std::size_t num_rungs) {
  FilterRow row{record.key, FilterStatus::kRanked, record.rung, record.drives, record.held_out};
  if (!all_detected(record.drives)) {
    row.status = FilterStatus::kNotDetected;
  } else if (record.rung + 1 < static_cast<int>(num_rungs)) {
    row.status = FilterStatus::kStopped;
  }
  return row;
}

/// Smaller is better, number by number.
std::tuple<int, double, double> order_of(const FilterRow& row) {
  const MeanScore mean = mean_score(row.drives);
  switch (row.status) {
    case FilterStatus::kRanked:
      return {0, mean.t_rel_percent.value_or(kWorst), mean.r_rel_deg_per_100m.value_or(kWorst)};
    case FilterStatus::kStopped:
      return {1, -row.rung, early_error(mean)};
    default:
      return {2, 0.0, 0.0};
  }
}

/// What survivors are chosen by: first detected or not and the early error; the other numbers tell
/// whether two filters are one.
struct Standing {
  std::tuple<int, double, double, double, double> numbers;
  const FilterKey* key = nullptr;
};

Standing standing_of(const Record& record) {
  const MeanScore mean = mean_score(record.drives);
  return {{all_detected(record.drives) ? 0 : 1, early_error(mean),
           mean.rotation_change_deg.value_or(kWorst), mean.average_offset_m.value_or(kWorst),
           mean.mean_inliers.value_or(0.0)},
          &record.key};
}

}  // namespace

MeanScore mean_score(const std::vector<DriveScore>& drives) {
  MeanScore mean;
  const auto average = [&drives](auto value) -> std::optional<double> {
    double sum = 0.0;
    for (const DriveScore& drive : drives) {
      if (!(drive.*value).has_value()) {
        return std::nullopt;
      }
      sum += *(drive.*value) / static_cast<double>(drives.size());
    }
    return sum;
  };
  mean.t_rel_percent = average(&DriveScore::t_rel_percent);
  mean.r_rel_deg_per_100m = average(&DriveScore::r_rel_deg_per_100m);
  mean.average_offset_m = average(&DriveScore::average_offset_m);
  mean.translation_change_m = average(&DriveScore::translation_change_m);
  mean.rotation_change_deg = average(&DriveScore::rotation_change_deg);
  mean.mean_inliers = average(&DriveScore::mean_inliers);
  mean.tracked_fraction = average(&DriveScore::tracked_fraction);
  mean.early_error_percent = average(&DriveScore::early_error_percent);
  for (const DriveScore& drive : drives) {
    mean.num_frames += drive.num_frames;
  }
  return mean;
}

std::string reason_of(const FilterRow& row) {
  for (const DriveScore& drive : row.drives) {
    if (!drive.is_detected) {
      return row.drives.size() > 1 ? drive.sequence + ": " + drive.reason : drive.reason;
    }
  }
  return {};
}

bool comes_before(const FilterKey& a, const FilterKey& b) {
  return std::tie(a.model, a.layer, a.features, a.filter) <
         std::tie(b.model, b.layer, b.features, b.filter);
}

std::vector<FilterRow> rank_filters(std::span<const Record> records, std::size_t num_rungs) {
  std::vector<const Record*> sorted;
  for (const Record& record : records) {
    sorted.push_back(&record);
  }
  std::sort(sorted.begin(), sorted.end(), [](const Record* a, const Record* b) {
    return comes_before(a->key, b->key) || (a->key == b->key && a->rung > b->rung);
  });
  std::vector<FilterRow> rows;
  for (const Record* record : sorted) {
    if (rows.empty() || !(rows.back().key == record->key)) {  // its last rung comes first
      rows.push_back(row_of(*record, num_rungs));
    }
  }
  std::stable_sort(rows.begin(), rows.end(), [](const FilterRow& a, const FilterRow& b) {
    return order_of(a) < order_of(b);
  });
  return rows;
}

std::vector<FilterKey> choose_survivors(const std::vector<const Record*>& records,
                                        std::size_t count) {
  std::vector<Standing> standings;
  for (const Record* record : records) {
    standings.push_back(standing_of(*record));
  }
  std::sort(standings.begin(), standings.end(), [](const Standing& a, const Standing& b) {
    return a.numbers < b.numbers || (a.numbers == b.numbers && comes_before(*a.key, *b.key));
  });
  // What gives the same numbers to the last bit is the same channel: one of them tells all.
  std::vector<const FilterKey*> order;
  std::vector<const FilterKey*> repeated;
  for (std::size_t i = 0; i < standings.size(); ++i) {
    const bool is_new = i == 0 || standings[i].numbers != standings[i - 1].numbers;
    (is_new ? order : repeated).push_back(standings[i].key);
  }
  order.insert(order.end(), repeated.begin(), repeated.end());
  std::vector<FilterKey> chosen;
  for (std::size_t i = 0; i < std::min(count, order.size()); ++i) {
    chosen.push_back(*order[i]);
  }
  return chosen;
}

}  // namespace stemvo::search
