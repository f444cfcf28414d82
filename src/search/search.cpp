// SPDX-License-Identifier: MIT
#include "stemvo/search/search.hpp"

#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "pipeline/out_folder.hpp"
#include "pipeline/thread_scope.hpp"
#include "search/plan.hpp"
#include "search/race.hpp"
#include "search/report.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;
using search::Record;
using search::RecordWriter;

/// Where a search goes on from.
struct Start {
  RecordWriter writer;
  std::vector<Record> records;
};

Expected<Start> start_new(const fs::path& file, const search::SearchIdentity& identity) {
  auto writer = RecordWriter::create(file, identity);
  if (!writer) {
    return writer.error();
  }
  return Start{std::move(*writer), {}};
}

Expected<Start> start(const SearchRequest& request, const search::SearchIdentity& identity) {
  const fs::path file = request.out_dir / search::kRecordsFile;
  std::error_code code;
  if (!fs::exists(file, code)) {
    return start_new(file, identity);
  }
  if (!request.resume) {
    return fail(
        fmt::format("{}: expected a folder without a search, found one: --resume goes on with it",
                    file.string()));
  }
  auto content = search::read_records(file);
  if (!content) {
    return content.error();
  }
  if (content->num_good_bytes == 0) {  // killed before its first line was written
    fs::remove(file, code);
    return start_new(file, identity);
  }
  if (const std::string change = search::describe_change(content->identity, identity, false);
      !change.empty()) {
    return fail(fmt::format("--resume: {}: {} since; give another --out, or what it was",
                            file.string(), change));
  }
  auto writer = RecordWriter::go_on(file, content->num_good_bytes);
  if (!writer) {
    return writer.error();
  }
  return Start{std::move(*writer), std::move(content->records)};
}

}  // namespace

Expected<SearchReport> run_search(const SearchRequest& request, const SearchProgress& progress) {
  const pipeline::ThreadScope threads(request.num_threads);
  const Expected<search::SearchPlan> plan = search::make_plan(request);
  if (!plan) {
    return plan.error();
  }
  if (const Status status = pipeline::create_out_folder(request.out_dir); !status) {
    return status.error();
  }
  Expected<Start> begun = start(request, plan->identity);
  if (!begun) {
    return begun.error();
  }
  search::Race race(*plan, request, progress, std::move(begun->writer), std::move(begun->records));
  if (const Status status = race.run(); !status) {
    return status.error();
  }
  return search::finish({request.out_dir, request.models_dir}, plan->identity, race.records(),
                        race.warnings());
}

}  // namespace stemvo
