// SPDX-License-Identifier: MIT
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>

#include "search/race.hpp"
#include "support/matchers.hpp"
#include "support/temp_folder.hpp"

namespace stemvo::search {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

LayerIdentity layer(int first, int last) {
  return {.model = "net",
          .layer = "stem",
          .features = "patch",
          .first = first,
          .last = last,
          .hash = "abc",
          .sampling_px = 2,
          .stem_model = "net"};
}

SearchIdentity identity(int first, int last) {
  SearchIdentity identity;
  identity.program = "program";
  identity.configuration = "seed: 1\nfeatures:\n  # levels\n  klt_levels: 3\n";
  identity.rungs = {{1.0, static_cast<std::size_t>(last - first)}};
  identity.layers = {layer(first, last)};
  identity.sequences = {{.name = "00",
                         .held_out = false,
                         .first_frame = 0,
                         .num_frames = 100,
                         .frames = "f",
                         .calibration = "c",
                         .ground_truth = "g",
                         .directory = "somewhere"}};
  return identity;
}

FilterRecord record(int filter, double t_rel = 1.0) {
  FilterRecord record;
  record.key = {"net", "stem", "patch", filter};
  record.filter_frames = 100;
  DriveScore score;
  score.sequence = "00";
  score.frames = 100;
  score.detected = true;
  score.t_rel_percent = t_rel;
  score.r_rel_deg_per_100m = 1.0 / 3.0;
  score.average_offset_m = 0.5;
  score.E_t_m = 0.01;
  score.E_r_deg = 0.02;
  score.early_error_percent = 1.25;
  score.inliers = 200.0;
  score.tracked = 0.75;
  score.dense_t_percent = {0.5, 0.1234, 2.0};
  score.block = 2;
  score.path_xz_m = {{0.0, 0.0}, {0.25, 1.5}};
  record.drives = {score};
  return record;
}

class Records : public ::testing::Test {
 protected:
  void write(const std::string& name, const SearchIdentity& of, std::vector<FilterRecord> records) {
    std::filesystem::create_directories(folder_ / name);
    auto writer = RecordFile::open(file(name), of, false);
    ASSERT_TRUE(writer) << writer.error().message;
    ASSERT_TRUE(writer->append(records));
  }
  [[nodiscard]] std::filesystem::path file(const std::string& name) const {
    return folder_ / name / "records.jsonl";
  }
  [[nodiscard]] Expected<SearchReport> merge(const std::vector<std::string>& names) const {
    std::vector<std::filesystem::path> parts;
    for (const std::string& name : names) {
      parts.push_back(folder_ / name);
    }
    return merge_searches(parts, folder_ / "merged", folder_.path());
  }

  testing::TempFolder folder_;
};

TEST_F(Records, ComeBackToTheBit) {
  write("a", identity(0, 2), {record(0, 0.1), record(1, 1e-17)});
  const auto content = read_records(file("a"));
  ASSERT_TRUE(content) << content.error().message;
  ASSERT_EQ(content->records.size(), 2U);
  EXPECT_EQ((*content->records.rbegin()).key, record(1).key);
  EXPECT_EQ((*content->records.rbegin()).drives, record(1, 1e-17).drives);
  EXPECT_EQ(*content->records.begin()->drives[0].r_rel_deg_per_100m, 1.0 / 3.0);
  EXPECT_EQ(content->identity.change_to(identity(0, 2), false), "");
  EXPECT_EQ(content->num_good_bytes, std::filesystem::file_size(file("a")));
}

TEST_F(Records, ATornLineIsLeftOutAndOverwritten) {
  write("a", identity(0, 3), {record(0)});
  std::ofstream(file("a"), std::ios::app) << R"({"model":"net","layer":"stem","filter":1,"feat)";
  auto content = read_records(file("a"));
  ASSERT_TRUE(content) << content.error().message;
  EXPECT_EQ(content->records.size(), 1U);
  auto writer = RecordFile::open(file("a"), content->identity, true);
  ASSERT_TRUE(writer) << writer.error().message;
  ASSERT_TRUE(writer->append(std::vector<FilterRecord>{record(2)}));
  content = read_records(file("a"));
  ASSERT_TRUE(content) << content.error().message;
  ASSERT_EQ(content->records.size(), 2U);
  EXPECT_EQ((*content->records.rbegin()).key.filter, 2);
}

TEST_F(Records, AWholeLineThatIsNoRecordIsLeftOutAndNamed) {
  write("a", identity(0, 3), {record(0)});
  std::ofstream(file("a"), std::ios::app) << "{\"model\": 1}\n";
  const auto content = read_records(file("a"));
  ASSERT_TRUE(content) << content.error().message;
  EXPECT_EQ(content->records.size(), 1U);
  ASSERT_EQ(content->warnings.size(), 1U);
  EXPECT_THAT(content->warnings.front(),
              AllOf(HasSubstr("records.jsonl:3: expected"), HasSubstr("left out")));
  EXPECT_FALSE(RecordFile::open(file("a"), identity(0, 3), false));  // never replaced
}

/// Somebody, or a broken disk, changes the second of three records.
TEST_F(Records, WhatNoSearchWritesIsLeftOutAndTheRestKept) {
  const std::vector<std::pair<std::string, std::string>> changes = {
      {R"("filter":1)", R"("filter":7)"},
      {R"("filter":1)", R"("filter":0)"},
      {R"("rung":0)", R"("rung":99)"},
      {R"("t_rel_percent":1.5)", R"("t_rel_percent":1.4)"},
      {R"("t_rel_percent":1.5)", R"("t_rel_percent":NaN)"},
      {R"("sequence":"00")", R"("sequence":"01")"},
      {R"("block":2)", R"("block":0)"},
      {R"("held_out":null)", R"("held_out":3)"},
      {R"("drives":[{)", R"("drives":[],"rives":[{)"},
      {R"("sha256":")", R"("sha256":"0)"},
      {R"("of":{)", ""}};
  write("a", identity(0, 3), {record(0), record(1, 1.5), record(2)});
  const std::string good = testing::read_all(file("a"));
  for (const auto& [from, to] : changes) {
    const std::size_t third_line = good.find('\n', good.find('\n') + 1) + 1;
    const std::size_t at = good.find(from, third_line);
    ASSERT_NE(at, good.npos) << from;
    std::ofstream(file("a")) << std::string(good).replace(at, from.size(), to);
    const auto content = read_records(file("a"));
    ASSERT_TRUE(content) << to << ": " << content.error().message;
    EXPECT_EQ(content->records.size(), 2U) << to;
    ASSERT_EQ(content->warnings.size(), 1U) << to;
    EXPECT_THAT(content->warnings.front(), HasSubstr("records.jsonl:3: ")) << to;
  }
}

TEST_F(Records, AnIdentityThatWasChangedIsAnError) {
  write("a", identity(0, 3), {record(0)});
  const std::string good = testing::read_all(file("a"));
  for (const auto& [from, to] : {std::pair(R"("rungs":[{)", R"("rungs":[],"ungs":[{)"),
                                 std::pair(R"("last":3)", R"("last":0)"),
                                 std::pair(R"("only_sequence":null)", R"("only_sequence":5)")}) {
    const std::size_t at = good.find(from);
    ASSERT_NE(at, good.npos) << from;
    std::ofstream(file("a")) << std::string(good).replace(at, std::string(from).size(), to);
    const auto content = read_records(file("a"));
    ASSERT_FALSE(content) << to;
    EXPECT_THAT(content.error().message, HasSubstr("records.jsonl:1: ")) << to;
  }
}

/// A line of another search, however whole, is none of this one's.
TEST_F(Records, ManyLinesThatAreNoRecordsAreCounted) {
  write("a", identity(0, 3), {record(0)});
  std::ofstream out(file("a"), std::ios::app);
  for (int i = 0; i < 1000; ++i) {
    out << "{\"model\": 1}\n";
  }
  out.close();
  const auto content = read_records(file("a"));
  ASSERT_TRUE(content) << content.error().message;
  EXPECT_EQ(content->records.size(), 1U);
  ASSERT_EQ(content->warnings.size(), 6U);
  EXPECT_EQ(content->warnings.back(), file("a").string() + ": 995 more lines left out");
}

TEST_F(Records, MoreLinesThatAreNoRecordsThanADamagedFileHasAreAnError) {
  write("a", identity(0, 3), {record(0)});
  std::ofstream out(file("a"), std::ios::app);
  for (int i = 0; i < 1001; ++i) {
    out << "{\"model\": 1}\n";
  }
  out.close();
  const auto content = read_records(file("a"));
  ASSERT_FALSE(content);
  EXPECT_THAT(content.error().message,
              AllOf(HasSubstr("records.jsonl:1003: expected a line as"),
                    HasSubstr("expected at most 1000 such lines, found more")));
}

TEST_F(Records, ALineLongerThanASearchWritesIsLeftOut) {
  write("a", identity(0, 3), {record(0)});
  std::ofstream(file("a"), std::ios::app) << std::string(kMaxRecordBytes + 1, ' ') << '\n';
  const auto content = read_records(file("a"));
  ASSERT_TRUE(content) << content.error().message;
  ASSERT_EQ(content->warnings.size(), 1U);
  EXPECT_THAT(content->warnings.front(), HasSubstr("records.jsonl:3: expected a line of at most"));
}

TEST_F(Records, WhoeverAsksStopsTheReading) {
  write("a", identity(0, 3), {record(0), record(1)});
  int num_asked = 0;
  const auto content = read_records(file("a"), [&] { return ++num_asked == 2; });
  ASSERT_FALSE(content);
  EXPECT_THAT(content.error().message, HasSubstr("records.jsonl: interrupted while it was read"));
  EXPECT_EQ(num_asked, 2);
}

TEST_F(Records, ALineOfAnotherSearchIsLeftOut) {
  write("a", identity(0, 3), {record(0)});
  write("b", identity(0, 4), {record(1)});
  const std::string other = testing::read_all(file("b"));
  std::ofstream(file("a"), std::ios::app) << other.substr(other.find('\n') + 1);
  const auto content = read_records(file("a"));
  ASSERT_TRUE(content) << content.error().message;
  EXPECT_EQ(content->records.size(), 1U);
  ASSERT_EQ(content->warnings.size(), 1U);
  EXPECT_THAT(content->warnings.front(), HasSubstr("records.jsonl:3: "));
}

/// Sealed, but nothing that a search of this identity writes: a seal is no proof.
TEST_F(Records, WhatNoSearchWritesIsNamedAndLeftOut) {
  FilterRecord no_rung = record(1);
  no_rung.rung = 9;
  FilterRecord no_drives = record(1);
  no_drives.drives.clear();
  FilterRecord of_another = record(1);
  of_another.drives[0].sequence = "01";
  FilterRecord beyond = record(1);
  beyond.drives[0].t_rel_percent = 1e300;
  const auto changed = [](auto change) {
    FilterRecord bad = record(1);
    change(bad.drives[0]);
    return bad;
  };
  FilterRecord more_work = record(1);
  more_work.filter_frames = 101;
  for (const auto& [bad, reason] :
       {std::pair(changed([](DriveScore& score) { score.tracked = 7.0; }),
                  "tracked: expected 0 to 1, found 7"),
        std::pair(changed([](DriveScore& score) { score.tracked = 0.4; }),
                  "detected, reason: expected what tracked, 0.4, says"),
        std::pair(changed([](DriveScore& score) { score.tracked.reset(); }),
                  "tracked, inliers: expected of a drive with frames"),
        std::pair(changed([](DriveScore& score) { score.E_r_deg = 181.0; }),
                  "E_r_deg: expected 0 to 180, found 181"),
        std::pair(changed([](DriveScore& score) { score.E_t_m.reset(); }), "expected errors and a"),
        std::pair(changed([](DriveScore& score) { score.path_xz_m.clear(); }), "and a path where"),
        std::pair(changed([](DriveScore& score) { score.dense_t_percent.clear(); }),
                  "dense_t_percent: expected of a drive over all frames"),
        std::pair(changed([](DriveScore& score) { score.frames = 60; }),
                  "00: expected 100 frames, found 60"),
        std::pair(more_work, "filter_frames: expected at most 100 of these drives, found 101"),
        std::pair(record(0, 3.0), "expected net stem 0 once on rung 0, found it again"),
        std::pair(record(7), "expected a filter of the search, found net stem 7"),
        std::pair(no_rung, "expected a rung below 1, found 9"),
        std::pair(no_drives, "expected drives over 1 sequences, found 0"),
        std::pair(of_another, "expected a drive of 00, found one of 01"),
        std::pair(beyond, "t_rel_percent: expected 0 to")}) {
    std::filesystem::remove_all(folder_ / "a");
    write("a", identity(0, 3), {record(0)});
    if (auto writer = RecordFile::open(file("a"), identity(0, 3), true)) {
      ASSERT_TRUE(writer->append({bad}));
    }
    const auto content = read_records(file("a"));
    ASSERT_TRUE(content) << content.error().message;
    EXPECT_EQ(content->records.size(), 1U) << reason;
    ASSERT_EQ(content->warnings.size(), 1U) << reason;
    EXPECT_THAT(content->warnings.front(), HasSubstr(reason));
  }
  SearchIdentity twice = identity(0, 3);
  twice.layers.push_back(twice.layers[0]);
  write("layers", twice, {});
  EXPECT_THAT(read_records(file("layers")).error().message,
              HasSubstr("expected filters of net stem once"));
  twice = identity(0, 3);
  twice.sequences.push_back(twice.sequences[0]);
  write("sequences", twice, {});
  EXPECT_THAT(read_records(file("sequences")).error().message,
              HasSubstr("00: expected a sequence"));
  SearchIdentity many = identity(0, 3);
  many.sequences.resize(301, many.sequences[0]);
  write("many", many, {});
  EXPECT_THAT(read_records(file("many")).error().message,
              HasSubstr("sequences: expected at most 300, found 301"));
  SearchIdentity no_sequences = identity(0, 3);
  no_sequences.sequences.clear();
  std::filesystem::remove_all(folder_ / "a");
  write("a", no_sequences, {});
  EXPECT_THAT(read_records(file("a")).error().message,
              HasSubstr("records.jsonl:1: expected rungs, layers and sequences, found none"));
}

/// Lists in lists, as deep as no stack is.
TEST_F(Records, ADeepIdentityIsAnError) {
  const std::string deep = std::string(1000000, '[') + std::string(1000000, ']');
  const auto content = read_records(folder_.file("deep", "{\"stemvo_search\":" + deep + "}\n"));
  ASSERT_FALSE(content);
  EXPECT_THAT(content.error().message,
              HasSubstr("deep:1: expected a line as this version of stemvo wrote it"));
}

TEST_F(Records, OneWriterAtATime) {
  const auto writer = RecordFile::open(folder_ / "records.jsonl", identity(0, 3), false);
  ASSERT_TRUE(writer);
  const auto second = RecordFile::open(folder_ / "records.jsonl", identity(0, 3), true);
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().message, HasSubstr("another search is writing it"));
}

TEST_F(Records, AreNotWrittenBeyondWhatIsReadAgain) {
  const auto file = folder_ / "records.jsonl";
  auto writer = RecordFile::open(file, identity(0, 3), false);
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->append({record(0)}));
  std::filesystem::resize_file(file, std::uintmax_t{kMaxRecords_MB} * 1000000 - 100);
  const Status status = writer->append({record(1)});
  ASSERT_FALSE(status);
  EXPECT_THAT(status.error().message, AllOf(HasSubstr("records.jsonl: expected at most 512 MB"),
                                            HasSubstr("an --out of their own")));
  EXPECT_EQ(std::filesystem::file_size(file), std::uintmax_t{kMaxRecords_MB} * 1000000 - 100);
  EXPECT_EQ(writer->records().size(), 1U);
}

TEST_F(Records, ChangesAreNamed) {
  const SearchIdentity before = identity(0, 3);
  SearchIdentity now = before;
  now.configuration = "seed: 1\nfeatures:\n  # levels\n  klt_levels: 4\n";
  now.sequences[0].frames = "other";
  EXPECT_EQ(before.change_to(now, true),
            "the configuration (klt_levels: 3, now klt_levels: 4) and the frames of 00 changed");
  now = before;
  now.layers[0].hash = "other";
  EXPECT_EQ(before.change_to(now, true), "the model net stem changed");
  now = before;
  now.layers[0].sampling_px = 4;
  EXPECT_THAT(before.change_to(now, true), HasSubstr("the sampling of net stem (2 px, now 4 px)"));
  now = identity(0, 4);
  EXPECT_THAT(before.change_to(now, false), HasSubstr("filters of net stem (0:3, now 0:4)"));
  EXPECT_EQ(before.change_to(now, true), "");
}

TEST_F(Records, PartsInAnyOrderGiveTheTableOfOneSearch) {
  write("whole", identity(0, 4), {record(0, 4), record(1, 1), record(2, 3), record(3, 2)});
  write("a", identity(0, 2), {record(0, 4), record(1, 1)});
  write("b", identity(1, 4), {record(1, 1), record(3, 2), record(2, 3)});  // 1 twice, agreeing
  const auto merged = merge({"b", "a"});
  ASSERT_TRUE(merged) << merged.error().message;
  EXPECT_THAT(merged->text, HasSubstr("work: 400 filter-frames, 100.0 % of an exhaustive search"));
  EXPECT_FALSE(merged->interrupted);
  const std::string csv = testing::read_all(folder_ / "merged" / "filters.csv");
  ASSERT_TRUE(merge_searches({folder_ / "whole"}, folder_ / "again", folder_.path()));
  EXPECT_EQ(csv, testing::read_all(folder_ / "again" / "filters.csv"));
  EXPECT_THAT(csv, AllOf(::testing::StartsWith("model,layer,filter,"),
                         HasSubstr("\nnet,stem,1,patch,ranked,1.0000,0.3333,")));
}

TEST_F(Records, PartsThatDoNotFitAreRefused) {
  write("a", identity(0, 2), {record(0), record(1)});
  write("unfinished", identity(2, 4), {record(2)});
  EXPECT_THAT(merge({"a", "unfinished"}).error().message,
              HasSubstr("expected 2 filters, found 1: finish it with --resume"));
  SearchIdentity other = identity(2, 3);
  other.sequences[0].ground_truth = "other";
  write("other", other, {record(2)});
  EXPECT_THAT(merge({"a", "other"}).error().message, HasSubstr("the pose file of 00 changed"));
  write("twice", identity(1, 2), {record(1, 7.0)});
  EXPECT_THAT(merge({"a", "twice"}).error().message, HasSubstr("net stem 1"));
  SearchIdentity halving = identity(2, 3);
  halving.rungs = halving_schedule(1);
  write("halving", halving, {record(2)});
  EXPECT_THAT(merge({"a", "halving"}).error().message, HasSubstr("--exhaustive"));
  EXPECT_FALSE(merge({"a", "nothing"}));
}

}  // namespace
}  // namespace stemvo::search
