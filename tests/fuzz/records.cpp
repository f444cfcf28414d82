// SPDX-License-Identifier: MIT
// The records of a search.
#include "search/records.hpp"

#include "fuzz_input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const fuzz::InputFile file(data, size);
  const auto read = search::read_records(file.path());
  fuzz::expect_said(read);
  if (!read) {
    return 0;
  }
  fuzz::expect(read->num_good_bytes <= size, "whole lines lie inside the file");
  for (const search::FilterRecord& record : read->records) {
    (void)read->identity.layer_of(record.key);
    (void)search::mean_score(record.drives);
  }
  fuzz::expect(read->identity.change_to(read->identity, false).empty(), "nothing changed");
  return 0;
}
