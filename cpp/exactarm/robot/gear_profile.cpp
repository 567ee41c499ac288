#include "exactarm/robot/gear_profile.hpp"

#include <algorithm>
#include <vector>

#include "exactarm/base/check.hpp"
#include "exactarm/robot/harmonics.hpp"

namespace exactarm {
namespace {

constexpr double kTolerance = 1e-10;  // rad
constexpr long kChunk = 128;          // cells whose columns stay in the cache

// Eight cells: their residual, and the columns of the Jacobian, each times the root of its weight.
struct Block {
  Lanes angle, value, root;
};

Block block(const AngleCells& cells, long from) {
  Block out{Lanes(0.0), Lanes(0.0), Lanes(0.0)};
  for (int lane = 0; lane < Lanes::kCount && from + lane < cells.angle.size(); ++lane) {
    out.angle.set(lane, cells.angle[from + lane]);
    out.value.set(lane, cells.value[from + lane]);
    out.root.set(lane, std::sqrt(cells.weight[from + lane]));
  }
  return out;
}

}  // namespace

ProfileNormal profile_normal(const AngleCells& cells, const GearTable& table, double level,
                             bool with_orders) {
  const long count = cells.angle.size(), m = table.size(), size = (with_orders ? 3 : 2) * m + 1;
  require_size("value of the profile", cells.value.size(), count);
  require_size("weight of the profile", cells.weight.size(), count);
  ProfileNormal out{Matrix::Zero(size, size), Vector::Zero(size), Vector(count)};
  Matrix columns(kChunk, size);
  Vector weighted(kChunk);
  std::vector<Lanes> sine(m), cosine(m);
  for (long first = 0; first < count; first += kChunk) {
    columns.setZero();
    weighted.setZero();
    for (long at = 0; at < kChunk && first + at < count; at += Lanes::kCount) {
      const Block cell = block(cells, first + at);
      Lanes x = cell.angle;
      deliver(table, cell.angle, Lanes(1.0), kTolerance, x, sine.data(), cosine.data());
      const HarmonicSums sums = harmonic_sums(table, x, sine.data(), cosine.data());
      const Lanes inverse = Lanes(1.0) / (Lanes(1.0) + sums.slope);  // dx / d angle
      const double scale = 1.0 + level;
      const Lanes model = cells.rated ? inverse * Lanes(scale) : sums.error + Lanes(level);
      const Lanes residual = cell.value - model;
      for (int lane = 0; lane < Lanes::kCount && first + at + lane < count; ++lane)
        out.residual[first + at + lane] = residual[lane];
      store(residual * cell.root, weighted.data() + at);
      // d model = outer (d s at fixed x + bent d e at fixed x): with x = angle - e(x), dx = -d e / (1 + s).
      const Lanes outer = cells.rated ? -inverse * inverse * Lanes(scale) * cell.root : inverse * cell.root;
      const Lanes bent = cells.rated ? -sums.bend * inverse : Lanes(1.0);
      const Lanes direct(cells.rated ? 1.0 : 0.0);
      const auto put_column = [&](long column, const Lanes& by_slope, const Lanes& by_error) {
        store(outer * (direct * by_slope + bent * by_error), columns.col(column).data() + at);
      };
      for (long j = 0; j < m; ++j) {
        const Lanes w(table.order()[j]), period(1.0 / table.order()[j]), a(table.a()[j]), b(table.b()[j]);
        const Lanes turned = cosine[j] - Lanes(1.0);
        put_column(j, cosine[j], sine[j] * period);
        put_column(m + j, -sine[j], turned * period);
        if (!with_orders) continue;
        const Lanes slope = cosine[j] * a - sine[j] * b, error = (sine[j] * a + turned * b) * period;
        put_column(2 * m + 1 + j, -x * (sine[j] * a + cosine[j] * b), (x * slope - error) * period);
      }
      store(cells.rated ? inverse * cell.root : cell.root, columns.col(2 * m).data() + at);
    }
    out.normal.selfadjointView<Eigen::Lower>().rankUpdate(columns.transpose());
    out.gradient.noalias() += columns.transpose() * weighted;
  }
  out.normal.triangularView<Eigen::StrictlyUpper>() = out.normal.transpose();
  return out;
}

}  // namespace exactarm
