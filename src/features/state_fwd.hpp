// SPDX-License-Identifier: MIT
#pragma once

namespace cereal {
class BinaryOutputArchive;
}  // namespace cereal

namespace stemvo {

/// What a state is written to and read from (odometry/state_archive.hpp).
using StateWriter = cereal::BinaryOutputArchive;
class StateReader;

}  // namespace stemvo
