// Counts calls of operator new in this process, to show that evaluations allocate nothing.
#pragma once

namespace exactarm::testing {

long allocation_count();

}  // namespace exactarm::testing
