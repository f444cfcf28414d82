// SPDX-License-Identifier: MIT
#include "stemvo/geometry/rigid3.hpp"
