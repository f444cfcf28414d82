// SPDX-License-Identifier: MIT
// The records of a search, as they come and sealed again.
#include "search/records.hpp"

#include <string_view>

#include "../support/sealed_records.hpp"
#include "fuzz_input.hpp"

namespace {

using namespace stemvo;

void read_and_rank(std::string_view text) {
  const fuzz::InputFile file(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  const auto read = search::read_records(file.path());
  fuzz::expect_said(read);
  if (!read || read->num_good_bytes == 0) {
    return;
  }
  fuzz::expect(read->num_good_bytes <= text.size(), "whole lines lie inside the file");
  for (const search::FilterRecord& record : read->records) {
    (void)read->identity.layer_of(record.key);
  }
  (void)search::format_csv(read->identity, search::rank_filters(read->identity, read->records));
  fuzz::expect(read->identity.change_to(read->identity, false).empty(), "nothing changed");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  read_and_rank(text);
  read_and_rank(test::seal_again(text));  // what is mutated is in the lines
  return 0;
}
