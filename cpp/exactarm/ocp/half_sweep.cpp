#include "exactarm/ocp/half_sweep.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace exactarm::ocp {

using Eigen::Map;

namespace {

// Rounding must not grow an antisymmetric part over thousands of knots.
inline void symmetrise(double* matrix, int size) {
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < j; ++i)
      matrix[j * size + i] = matrix[i * size + j] = 0.5 * (matrix[j * size + i] + matrix[i * size + j]);
}

}  // namespace

template <int Axes, int MotorOrder>
HalfSweep<Axes, MotorOrder>::HalfSweep(const Layout& layout, long first, long count, int direction)
    : axes_(layout.axes), layout_(layout), first_(first), count_(count), direction_(direction) {
  // A chain of states b, b + 1, ... ending in its input: x_b = sigma_b + direction / 2 x_{b+1}.
  const auto chain = [&](int begin, int end, int input) {
    for (int b = end - 1; b >= begin; --b) {
      x_of_[b][b] = 1.0;
      if (b == end - 1)
        x_of_[b][input] = 0.5 * direction;
      else
        for (int c = 0; c < kBlocks; ++c) x_of_[b][c] += 0.5 * direction * x_of_[b + 1][c];
    }
  };
  chain(0, kLinkOrder, kStateBlocks);
  chain(kLinkOrder, kStateBlocks, kStateBlocks + 1);
  for (int b = 0; b < kStateBlocks; ++b)
    for (int c = 0; c < kBlocks; ++c) out_of_[b][c] = 2.0 * x_of_[b][c] - (b == c ? 1.0 : 0.0);
  const long s = states(), m = n(), r = rest();
  knot_size_ = s * s + 2 * m * r + m * s + 3 * m * m + 2 * m + s + m;
  memory_.assign(knot_size_ * (count_ + 1), 0.0);
  hessian_.setZero(width(), width());
  half_.setZero(width(), width());
  quadratic_.setZero(width(), width());
  compliance_.setZero(s, s);
  covariance_.setZero(width(), width());
  joint_.setZero(2 * m, s);
  cross_.setZero(s, 2 * m);
  work_.setZero(4 * width());
}

template <int Axes, int MotorOrder>
typename HalfSweep<Axes, MotorOrder>::Knot HalfSweep<Axes, MotorOrder>::at(long position) {
  const long s = states(), m = n(), r = rest();
  double* p = memory_.data() + position * knot_size_;
  const auto take = [&](long size) {
    double* start = p;
    p += size;
    return start;
  };
  Knot knot;
  knot.value = take(s * s);
  knot.qdd_by_rest = take(m * r);
  knot.rest_by_qdd = take(m * r);
  knot.gain = take(m * s);
  knot.qdd_by_qdd = take(m * m);
  knot.inverse = take(m * m);
  knot.input_inverse = take(m * m);
  knot.qdd_offset = take(m);
  knot.input_offset = take(m);
  knot.gradient = take(s);
  knot.qdd_gradient = take(m);
  return knot;
}

// Order of the blocks of y: sigma, qdd, input. The Hessian of z in that order: states, qdd, input.
template <int Axes, int MotorOrder>
void HalfSweep<Axes, MotorOrder>::gather_hessian(const StageDerivatives& d, const Vector& diagonal, long k) {
  const int m = n(), m2 = m * m;
  const int theta = kLinkOrder * m, qdd = kStateBlocks * m;
  hessian_.setZero();
  const double *qq = &d.q_q[k * m2], *qv = &d.q_q_dot[k * m2], *vv = &d.q_dot_q_dot[k * m2],
               *qa = &d.q_q_ddot[k * m2];
  for (int j = 0; j < m; ++j)
    for (int i = 0; i < m; ++i) {
      const int e = j * m + i;
      hessian_(i, j) = qq[e];
      hessian_(i, m + j) = hessian_(m + j, i) = qv[e];
      hessian_(m + i, m + j) = vv[e];
      hessian_(i, qdd + j) = hessian_(qdd + j, i) = qa[e];
    }
  for (int i = 0; i < m; ++i) {
    hessian_(i, theta + i) = hessian_(theta + i, i) = d.q_theta[k * m + i];
    hessian_(theta + i, theta + i) = d.theta_theta[k * m + i];
  }
  const double* extra = &diagonal[k * width()];
  for (int b = 0; b < kStateBlocks; ++b)
    for (int i = 0; i < m; ++i) hessian_(b * m + i, b * m + i) += extra[Layout::state_block(b) * m + i];
  for (int i = 0; i < m; ++i) {
    hessian_(qdd + i, qdd + i) += extra[kQDdot * m + i];
    hessian_(qdd + m + i, qdd + m + i) += extra[layout_.input() * m + i];
  }
}

template <int Axes, int MotorOrder>
bool HalfSweep<Axes, MotorOrder>::eliminate(const StageDerivatives& d, long position) {
  const int m = n(), s = states(), w = width(), r = rest(), m2 = m * m;
  const long k = knot(position);
  const Knot here = at(position), next = at(position + 1);

  // G = T' H T + T_out' P T_out, first the columns, then the rows.
  const auto congruence = [&](const double* matrix, int blocks, const double (*map)[kBlocks], bool inputs) {
    const int size = blocks * m;
    half_.setZero();
    for (int b = 0; b < kStateBlocks; ++b)
      for (int c = 0; c < kBlocks; ++c)
        if (map[b][c] != 0.0)
          for (int j = 0; j < m; ++j) {
            const double factor = map[b][c];
            const double* from = matrix + (b * m + j) * size;
            double* to = half_.data() + (c * m + j) * w;
            for (int i = 0; i < size; ++i) to[i] += factor * from[i];
          }
    if (inputs)
      for (int j = 0; j < 2 * m; ++j) {
        const double* from = matrix + (s + j) * size;
        double* to = half_.data() + (s + j) * w;
        for (int i = 0; i < size; ++i) to[i] += from[i];
      }
    for (int column = 0; column < w; ++column) {
      const double* from = half_.data() + column * w;
      double* to = quadratic_.data() + column * w;
      for (int b = 0; b < kStateBlocks; ++b)
        for (int c = 0; c < kBlocks; ++c)
          if (map[b][c] != 0.0)
            for (int i = 0; i < m; ++i) to[c * m + i] += map[b][c] * from[b * m + i];
      if (inputs)
        for (int i = 0; i < 2 * m; ++i) to[s + i] += from[s + i];
    }
  };
  quadratic_.setZero();
  congruence(hessian_.data(), kBlocks, x_of_, true);
  congruence(next.value, kStateBlocks, out_of_, false);

  // J y = -r with J = (by_q, by_q_dot, by_q_ddot, by_theta) T; qdd = qdd_by_rest rest - inverse r.
  using Square = Eigen::Matrix<double, Axes, Axes>;
  using Wide = Eigen::Matrix<double, Axes, Eigen::Dynamic>;
  const Map<const Square> by_q(&d.by_q[k * m2], m, m), by_q_dot(&d.by_q_dot[k * m2], m, m),
      by_q_ddot(&d.by_q_ddot[k * m2], m, m);
  const double half = 0.5 * direction_;
  const Square by_rate = by_q_dot + half * by_q;
  Map<Square> inverse(here.inverse, m, m);
  inverse = Square(by_q_ddot + half * by_rate).inverse();
  if (!inverse.allFinite()) return false;
  Map<Wide> by_rest(here.qdd_by_rest, m, r);
  by_rest.leftCols(m).noalias() = -inverse.lazyProduct(by_q);
  by_rest.middleCols(m, m).noalias() = -inverse.lazyProduct(by_rate);
  const int theta = kLinkOrder * m;
  for (int i = 0; i < m; ++i) by_rest.col(theta + i) = -d.by_theta[k * m + i] * inverse.col(i);
  for (int b = 1; b <= MotorOrder; ++b)
    by_rest.middleCols(theta + b * m, m) = half * by_rest.middleCols(theta + (b - 1) * m, m);

  // Substitute qdd: rest_by_rest += W by_rest + by_rest' W', W = rest_by_qdd + by_rest' qdd_by_qdd / 2.
  const auto rest_row = [&](int i) { return i < s ? i : i + m; };
  Map<Matrix> rest_by_qdd(here.rest_by_qdd, r, m);
  Map<Square> qdd_by_qdd(here.qdd_by_qdd, m, m);
  for (int j = 0; j < m; ++j) {
    for (int i = 0; i < r; ++i) rest_by_qdd(i, j) = quadratic_(rest_row(i), s + j);
    for (int i = 0; i < m; ++i) qdd_by_qdd(i, j) = quadratic_(s + i, s + j);
  }
  double* factor = half_.data();
  std::copy_n(here.rest_by_qdd, r * m, factor);
  for (int j = 0; j < m; ++j)
    for (int l = 0; l < m; ++l) {
      const double value = 0.5 * qdd_by_qdd(l, j);
      for (int i = 0; i < r; ++i) factor[j * r + i] += value * by_rest(l, i);
    }
  double* product = half_.data() + r * m;
  std::fill_n(product, r * r, 0.0);
  add_product(r, m, r, factor, here.qdd_by_rest, product);
  double* reduced = covariance_.data();  // r x r, free until the compliance
  for (int j = 0; j < r; ++j)
    for (int i = 0; i < r; ++i)
      reduced[j * r + i] = quadratic_(rest_row(i), rest_row(j)) + product[j * r + i] + product[i * r + j];

  // Eliminate the input: gain = -R^{-1} S', value = Q + S gain.
  Square input(m, m);
  for (int j = 0; j < m; ++j)
    for (int i = 0; i < m; ++i) input(i, j) = reduced[(s + j) * r + s + i];
  const Eigen::LLT<Square> cholesky(input);
  if (cholesky.info() != Eigen::Success) return false;
  Map<Square> input_inverse(here.input_inverse, m, m);
  input_inverse = cholesky.solve(Square::Identity(m, m));
  Map<Wide> gain(here.gain, m, s);
  double* cross = half_.data();  // s x m
  for (int j = 0; j < m; ++j) std::copy_n(reduced + (s + j) * r, s, cross + j * s);
  for (int j = 0; j < s; ++j)
    for (int i = 0; i < m; ++i) {
      double sum = 0.0;
      for (int l = 0; l < m; ++l) sum -= input_inverse(i, l) * cross[l * s + j];
      gain(i, j) = sum;
    }
  for (int j = 0; j < s; ++j) std::copy_n(reduced + j * r, s, here.value + j * s);
  add_product(s, m, s, cross, here.gain, here.value);
  symmetrise(here.value, s);
  return true;
}

template <int Axes, int MotorOrder>
bool HalfSweep<Axes, MotorOrder>::factorise(const StageDerivatives& d, const Vector& diagonal) {
  std::fill_n(at(count_).value, states() * states(), 0.0);
  for (long position = count_ - 1; position >= 0; --position) {
    gather_hessian(d, diagonal, knot(position));
    if (!eliminate(d, position)) return false;
  }
  propagate_compliance();
  return true;
}

// Covariance of y when every input has the noise R^{-1}: sigma = compliance, (qdd, input) = joint sigma + noise.
template <int Axes, int MotorOrder>
void HalfSweep<Axes, MotorOrder>::propagate_compliance() {
  const int m = n(), s = states(), w = width(), m2 = 2 * m;
  using Square = Eigen::Matrix<double, Axes, Axes>;
  compliance_.setZero();
  double* transposed = work_.data();
  for (long position = 0; position < count_; ++position) {
    const Knot here = at(position);
    // joint = (qdd_by_sigma + qdd_by_input gain; gain), 2n x s.
    const double* by_input = here.qdd_by_rest + s * m;
    for (int j = 0; j < s; ++j) {
      double* column = joint_.data() + j * m2;
      for (int i = 0; i < m; ++i) column[i] = here.qdd_by_rest[j * m + i];
      for (int l = 0; l < m; ++l) {
        const double value = here.gain[j * m + l];
        column[m + l] = value;
        for (int i = 0; i < m; ++i) column[i] += by_input[l * m + i] * value;
      }
    }
    // cross = compliance joint', corner = joint cross.
    cross_.setZero();
    for (int l = 0; l < s; ++l)
      for (int j = 0; j < m2; ++j) {
        const double value = joint_.data()[l * m2 + j];
        double* to = cross_.data() + j * s;
        const double* from = compliance_.data() + l * s;
        for (int i = 0; i < s; ++i) to[i] += value * from[i];
      }
    covariance_.setZero();
    for (int j = 0; j < s; ++j) std::copy_n(compliance_.data() + j * s, s, covariance_.data() + j * w);
    for (int j = 0; j < m2; ++j) {
      double* column = covariance_.data() + (s + j) * w;
      std::copy_n(cross_.data() + j * s, s, column);
      for (int i = 0; i < s; ++i) covariance_.data()[i * w + s + j] = column[i];
      for (int l = 0; l < s; ++l) {
        const double value = column[l];
        const double* from = joint_.data() + l * m2;
        for (int i = 0; i < m2; ++i) column[s + i] += value * from[i];
      }
    }
    const Map<const Square> noise(here.input_inverse, m, m), turn(by_input, m, m);
    const Square turned = turn.lazyProduct(noise);
    const Square both = turned.lazyProduct(turn.transpose());
    for (int j = 0; j < m; ++j)
      for (int i = 0; i < m; ++i) {
        covariance_(s + i, s + j) += both(i, j);
        covariance_(s + i, s + m + j) += turned(i, j);
        covariance_(s + m + j, s + i) += turned(i, j);
        covariance_(s + m + i, s + m + j) += noise(i, j);
      }
    // compliance = out covariance out'.
    half_.setZero();
    for (int b = 0; b < kStateBlocks; ++b)
      for (int c = 0; c < kBlocks; ++c)
        if (out_of_[b][c] != 0.0)
          for (int j = 0; j < m; ++j) {
            const double* from = covariance_.data() + (c * m + j) * w;
            double* to = half_.data() + (b * m + j) * w;
            for (int i = 0; i < w; ++i) to[i] += out_of_[b][c] * from[i];
          }
    for (int column = 0; column < s; ++column) {
      const double* from = half_.data() + column * w;
      std::fill_n(transposed, s, 0.0);
      for (int b = 0; b < kStateBlocks; ++b)
        for (int c = 0; c < kBlocks; ++c)
          if (out_of_[b][c] != 0.0)
            for (int i = 0; i < m; ++i) transposed[b * m + i] += out_of_[b][c] * from[c * m + i];
      std::copy_n(transposed, s, compliance_.data() + column * s);
    }
    symmetrise(compliance_.data(), s);
  }
}

template class HalfSweep<6, 2>;
template class HalfSweep<6, 3>;
template class HalfSweep<Eigen::Dynamic, 2>;
template class HalfSweep<Eigen::Dynamic, 3>;

}  // namespace exactarm::ocp
