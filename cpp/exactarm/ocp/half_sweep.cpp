#include "exactarm/ocp/half_sweep.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "exactarm/base/interrupt.hpp"

namespace exactarm::ocp {

using Eigen::Map;

namespace {

constexpr double kLeastPivot = 1e-8;  // of the largest of its block

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
  for (int c = 0; c < kBlocks; ++c)
    for (int b = 0, first = 1; b < kStateBlocks; ++b)
      if (out_of_[b][c] != 0.0) {
        terms_by_input_.push_back({b, c, out_of_[b][c], first == 1});
        first = 0;
      }
  for (int b = 0; b < kStateBlocks; ++b)
    for (int c = 0, first = 1; c < kBlocks; ++c)
      if (out_of_[b][c] != 0.0) {
        terms_by_output_.push_back({b, c, out_of_[b][c], first == 1});
        first = 0;
      }
  const long s = states(), m = n(), r = rest(), w = width();
  knot_size_ = s * s + 2 * m * r + m * s + 3 * m * m + 2 * m + s + m;
  memory_.assign(knot_size_ * (count_ + 1), 0.0);
  half_.setZero(w, w);
  quadratic_.setZero(w, w);
  compliance_.setZero(s, s);
  covariance_.setZero(w, w);
  for (auto* v : {&rest_transposed_, &factor_, &cross_}) v->assign(r * 2 * m, 0.0);
  for (auto* v : {&reduced_, &product_}) v->assign(r * r, 0.0);
  for (auto* v : {&joint_, &joint_transposed_, &gain_transposed_}) v->assign(s * 2 * m, 0.0);
  corner_.assign(4 * m * m, 0.0);
  for (Square& block : blocks_) block.setZero(m, m);
  work_.setZero(4 * w);
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

template <int Axes, int MotorOrder>
void HalfSweep<Axes, MotorOrder>::carry_value(const double* value) {
  const int m = n(), s = states(), w = width(), panel = m * s;
  for (const Term& term : terms_by_input_) {
    const double* from = value + term.b * panel;
    double* to = half_.data() + term.c * panel;
    if (term.first)
      for (int i = 0; i < panel; ++i) to[i] = term.factor * from[i];
    else
      for (int i = 0; i < panel; ++i) to[i] += term.factor * from[i];
  }
  for (int column = 0; column < w; ++column) {
    const double* from = half_.data() + column * s;
    double* to = quadratic_.data() + column * w;
    for (const Term& term : terms_by_input_)
      if (term.first)
        for (int i = 0; i < m; ++i) to[term.c * m + i] = term.factor * from[term.b * m + i];
      else
        for (int i = 0; i < m; ++i) to[term.c * m + i] += term.factor * from[term.b * m + i];
  }
}

// q = sigma_q + e q_dot, q_dot = sigma_v + e qdd: first the columns of the Hessian, then its rows.
template <int Axes, int MotorOrder>
void HalfSweep<Axes, MotorOrder>::add_link_hessian(const StageDerivatives& d, const double* diagonal,
                                                   long k) {
  const int m = n(), m2 = m * m, w = width(), qdd = states();
  const double e = 0.5 * direction_;
  const Map<const Square> h_qv(&d.q_q_dot[k * m2], m, m), h_qa(&d.q_q_ddot[k * m2], m, m);
  Square &qq = blocks_[0], &qv = blocks_[1], &qa = blocks_[2], &vv = blocks_[3], &va = blocks_[4],
         &aa = blocks_[5];
  qq = Map<const Square>(&d.q_q[k * m2], m, m);
  qq.diagonal() += Map<const Vector>(diagonal + kQ * m, m);
  qv = h_qv + e * qq;
  qa = h_qa + e * qv;
  vv = Map<const Square>(&d.q_dot_q_dot[k * m2], m, m) + e * h_qv.transpose();
  vv.diagonal() += Map<const Vector>(diagonal + kQDot * m, m);
  va = e * (vv + qa);
  vv += e * qv;
  aa = e * e * h_qa.transpose() + e * va;
  aa.diagonal() += Map<const Vector>(diagonal + kQDdot * m, m);
  const auto add = [&](int row, int column, const Square& block) {
    for (int j = 0; j < m; ++j)
      for (int i = 0; i < m; ++i) {
        quadratic_.data()[(column + j) * w + row + i] += block(i, j);
        if (row != column) quadratic_.data()[(row + i) * w + column + j] += block(i, j);
      }
  };
  add(0, 0, qq);
  add(0, m, qv);
  add(0, qdd, qa);
  add(m, m, vv);
  add(m, qdd, va);
  add(qdd, qdd, aa);
}

// What belongs to the motor is diagonal in the axes.
template <int Axes, int MotorOrder>
void HalfSweep<Axes, MotorOrder>::add_motor_hessian(const StageDerivatives& d, const double* diagonal,
                                                    long k) {
  const int m = n(), w = width();
  const auto add = [&](int first, int second, double factor, const double* values) {
    for (int i = 0; i < m; ++i) quadratic_.data()[(second * m + i) * w + first * m + i] += factor * values[i];
  };
  double* const values = blocks_[7].data();  // one number an axis
  for (int b = kLinkOrder; b < kStateBlocks; ++b) {
    for (int i = 0; i < m; ++i)
      values[i] =
          diagonal[Layout::state_block(b) * m + i] + (b == kLinkOrder ? d.theta_theta[k * m + i] : 0.0);
    for (int c1 = b; c1 < kBlocks; ++c1)
      for (int c2 = b; c2 < kBlocks; ++c2)
        if (x_of_[b][c1] != 0.0 && x_of_[b][c2] != 0.0) add(c1, c2, x_of_[b][c1] * x_of_[b][c2], values);
  }
  add(kBlocks - 1, kBlocks - 1, 1.0, diagonal + layout_.input() * m);
  const double* q_theta = &d.q_theta[k * m];
  for (int c1 : {0, 1, kStateBlocks})
    for (int c2 = kLinkOrder; c2 < kBlocks; ++c2)
      if (c2 != kStateBlocks && x_of_[kLinkOrder][c2] != 0.0) {
        add(c1, c2, x_of_[0][c1] * x_of_[kLinkOrder][c2], q_theta);
        add(c2, c1, x_of_[0][c1] * x_of_[kLinkOrder][c2], q_theta);
      }
}

// J y = -r gives qdd = by_rest rest - inverse r; substituted, quadratic_ becomes reduced_ (rest x rest):
//   Q_rr + W by_rest + by_rest' W',   W = rest_by_qdd + by_rest' qdd_by_qdd / 2
template <int Axes, int MotorOrder>
bool HalfSweep<Axes, MotorOrder>::eliminate_qdd(const StageDerivatives& d, long k, const Knot& here) {
  const int m = n(), s = states(), w = width(), r = rest(), m2 = m * m, theta = kLinkOrder * m;
  const double e = 0.5 * direction_;
  using Wide = Eigen::Matrix<double, Axes, Eigen::Dynamic>;
  const Map<const Square> by_q(&d.by_q[k * m2], m, m), by_q_dot(&d.by_q_dot[k * m2], m, m),
      by_q_ddot(&d.by_q_ddot[k * m2], m, m);
  Square &by_rate = blocks_[0], &local = blocks_[1];
  by_rate = by_q_dot + e * by_q;
  local = by_q_ddot + e * by_rate;
  Map<Square> inverse(here.inverse, m, m);
  inverse = local.partialPivLu().inverse();
  if (!inverse.allFinite()) return false;
  Map<Wide> by_rest(here.qdd_by_rest, m, r);
  by_rest.leftCols(m).noalias() = -inverse.lazyProduct(by_q);
  by_rest.middleCols(m, m).noalias() = -inverse.lazyProduct(by_rate);
  for (int i = 0; i < m; ++i) by_rest.col(theta + i) = -d.by_theta[k * m + i] * inverse.col(i);
  for (int b = 1; b <= MotorOrder; ++b)
    by_rest.middleCols(theta + b * m, m) = e * by_rest.middleCols(theta + (b - 1) * m, m);

  transpose(m, r, here.qdd_by_rest, rest_transposed_.data());
  for (int j = 0; j < m; ++j) {
    const double* column = quadratic_.data() + (s + j) * w;
    std::copy_n(column, s, here.rest_by_qdd + j * r);
    std::copy_n(column + s, m, here.qdd_by_qdd + j * m);
    std::copy_n(column + s + m, m, here.rest_by_qdd + j * r + s);
  }
  std::copy_n(here.rest_by_qdd, r * m, factor_.data());
  local = 0.5 * Map<const Square>(here.qdd_by_qdd, m, m);
  add_product<kR, kN>(r, m, m, rest_transposed_.data(), local.data(), factor_.data());
  std::fill_n(product_.data(), r * r, 0.0);
  add_product<kR, kN>(r, m, r, factor_.data(), here.qdd_by_rest, product_.data());
  for (int j = 0; j < r; ++j) {
    const double* column = quadratic_.data() + (j < s ? j : j + m) * w;
    const double* product = product_.data() + j * r;
    double* to = reduced_.data() + j * r;
    for (int i = 0; i < s; ++i) to[i] = column[i] + product[i] + product_[i * r + j];
    for (int i = s; i < r; ++i) to[i] = column[m + i] + product[i] + product_[i * r + j];
  }
  return true;
}

// input = gain sigma + ..., gain = -R^{-1} S'; value = Q + S gain.
template <int Axes, int MotorOrder>
bool HalfSweep<Axes, MotorOrder>::eliminate_input(const Knot& here) {
  const int m = n(), s = states(), r = rest();
  Square &input = blocks_[0], &negative = blocks_[1];
  for (int j = 0; j < m; ++j) std::copy_n(reduced_.data() + (s + j) * r + s, m, input.data() + j * m);
  Map<Square> input_inverse(here.input_inverse, m, m);
  input_inverse = input;
  const Eigen::LLT<Eigen::Ref<Square>> cholesky(input);
  if (cholesky.info() == Eigen::Success) {
    input_inverse.setIdentity();
    cholesky.solveInPlace(input_inverse);
  } else if (!invert_indefinite(input_inverse)) {
    return false;
  }
  negative = -input_inverse;
  for (int j = 0; j < m; ++j) std::copy_n(reduced_.data() + (s + j) * r, s, cross_.data() + j * s);
  std::fill_n(gain_transposed_.data(), s * m, 0.0);
  add_product<kS, kN>(s, m, m, cross_.data(), negative.data(), gain_transposed_.data());
  transpose(s, m, gain_transposed_.data(), here.gain);
  for (int j = 0; j < s; ++j) std::copy_n(reduced_.data() + j * r, s, here.value + j * s);
  add_product<kS, kN>(s, m, s, cross_.data(), here.gain, here.value);
  symmetrise(here.value, s);
  return true;
}

// With a free middle a half may have directions that raise nothing,
// or lower the cost, though the whole has none.
template <int Axes, int MotorOrder>
template <class Block>
bool HalfSweep<Axes, MotorOrder>::invert_indefinite(Block& block) {
  const Eigen::SelfAdjointEigenSolver<Square> eigen(block);
  const auto& values = eigen.eigenvalues();
  if (!(values.cwiseAbs().minCoeff() > kLeastPivot * values.cwiseAbs().maxCoeff())) return false;
  negative_pivots_ += static_cast<int>((values.array() < 0.0).count());
  block = eigen.eigenvectors() * values.cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose();
  return true;
}

template <int Axes, int MotorOrder>
bool HalfSweep<Axes, MotorOrder>::factorise(const StageDerivatives& d, const Vector& diagonal) {
  negative_pivots_ = 0;
  std::fill_n(at(count_).value, states() * states(), 0.0);
  for (long position = count_ - 1; position >= 0; --position) {
    if (position % kKnotsBetweenChecks == 0) check_interrupt();
    const long k = knot(position);
    const Knot here = at(position);
    carry_value(at(position + 1).value);
    add_link_hessian(d, diagonal.data() + k * width(), k);
    add_motor_hessian(d, diagonal.data() + k * width(), k);
    if (!eliminate_qdd(d, k, here) || !eliminate_input(here)) return false;
  }
  propagate_compliance();
  return true;
}

// Covariance of y when every input has the noise R^{-1}:
// sigma = compliance, (qdd, input) = joint sigma + noise.
template <int Axes, int MotorOrder>
void HalfSweep<Axes, MotorOrder>::propagate_compliance() {
  const int m = n(), s = states(), w = width(), m2 = 2 * m;
  compliance_.setZero();
  double* cov = covariance_.data();
  for (long position = 0; position < count_; ++position) {
    if (position % kKnotsBetweenChecks == 0) check_interrupt();
    const Knot here = at(position);
    // joint' = (qdd_by_sigma + qdd_by_input gain; gain)', s x 2n.
    transpose(m, s, here.gain, joint_transposed_.data() + s * m);
    transpose(m, s, here.qdd_by_rest, joint_transposed_.data());
    Square &turn = blocks_[0], &turn_transposed = blocks_[1], &turned = blocks_[2], &both = blocks_[3];
    turn = Map<const Square>(here.qdd_by_rest + s * m, m, m);
    turn_transposed = turn.transpose();
    add_product<kS, kN>(s, m, m, joint_transposed_.data() + s * m, turn_transposed.data(),
                        joint_transposed_.data());
    transpose(s, m2, joint_transposed_.data(), joint_.data());
    // cross = compliance joint', corner = joint cross.
    std::fill_n(cross_.data(), s * m2, 0.0);
    add_product<kS, kS>(s, s, m2, compliance_.data(), joint_transposed_.data(), cross_.data());
    std::fill_n(corner_.data(), m2 * m2, 0.0);
    add_product<2 * kN, kS>(m2, s, m2, joint_.data(), cross_.data(), corner_.data());
    const Map<const Square> noise(here.input_inverse, m, m);
    turned.noalias() = turn.lazyProduct(noise);
    both.noalias() = turned.lazyProduct(turn_transposed);
    for (int j = 0; j < s; ++j) {
      std::copy_n(compliance_.data() + j * s, s, cov + j * w);
      for (int i = 0; i < m2; ++i) cov[j * w + s + i] = cross_[i * s + j];
    }
    for (int j = 0; j < m2; ++j) {
      std::copy_n(cross_.data() + j * s, s, cov + (s + j) * w);
      std::copy_n(corner_.data() + j * m2, m2, cov + (s + j) * w + s);
    }
    for (int j = 0; j < m; ++j)
      for (int i = 0; i < m; ++i) {
        cov[(s + j) * w + s + i] += both(i, j);
        cov[(s + m + j) * w + s + i] += turned(i, j);
        cov[(s + j) * w + s + m + i] += turned(j, i);
        cov[(s + m + j) * w + s + m + i] += noise(i, j);
      }
    // compliance = out covariance out'.
    for (const Term& term : terms_by_output_) {
      const double* from = cov + term.c * m * w;
      double* to = half_.data() + term.b * m * w;
      const int panel = m * w;
      if (term.first)
        for (int i = 0; i < panel; ++i) to[i] = term.factor * from[i];
      else
        for (int i = 0; i < panel; ++i) to[i] += term.factor * from[i];
    }
    for (int column = 0; column < s; ++column) {
      const double* from = half_.data() + column * w;
      double* to = compliance_.data() + column * s;
      for (const Term& term : terms_by_output_)
        if (term.first)
          for (int i = 0; i < m; ++i) to[term.b * m + i] = term.factor * from[term.c * m + i];
        else
          for (int i = 0; i < m; ++i) to[term.b * m + i] += term.factor * from[term.c * m + i];
    }
    symmetrise(compliance_.data(), s);
  }
}

template class HalfSweep<6, 2>;
template class HalfSweep<6, 3>;
template class HalfSweep<Eigen::Dynamic, 2>;
template class HalfSweep<Eigen::Dynamic, 3>;

}  // namespace exactarm::ocp
