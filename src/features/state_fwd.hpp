// SPDX-License-Identifier: MIT
#pragma once

namespace cereal {
class BinaryOutputArchive;
class BinaryInputArchive;
}  // namespace cereal

namespace stemvo {

/// What a state is written to and read from (odometry/state_archive.hpp).
using StateWriter = cereal::BinaryOutputArchive;
using StateReader = cereal::BinaryInputArchive;

}  // namespace stemvo
