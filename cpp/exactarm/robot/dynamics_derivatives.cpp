#include "exactarm/robot/dynamics_derivatives.hpp"

#include "exactarm/base/parallel.hpp"
#include "exactarm/robot/lane_rows.hpp"

namespace exactarm {
namespace {

using LaneVec = spatial::Vec3<Lanes>;
using LaneTwist = spatial::Twist<Lanes>;
using LaneWrench = spatial::Wrench<Lanes>;
using LaneInertia = spatial::SpatialInertia<Lanes>;
using LaneInertiaRate = spatial::InertiaRate<Lanes>;

constexpr long kLeastKnotsAThread = 64;

enum Result { kDtauDq, kDtauDqDot, kMass, kQQ, kQQDot, kQDotQDot, kQQDdot, kMatrices };

// Sums over all links outboard of an axis, the axis' own link included.
template <bool kSecond>
struct Composite {
  LaneInertia inertia;
  LaneInertiaRate rate;        // of the inertia, along v
  LaneWrench momentum, force;  // I v, I a + v x* I v

  static Composite zero() {
    return {LaneInertia::zero(), LaneInertiaRate::zero(), LaneWrench::zero(), LaneWrench::zero()};
  }
  Composite& operator+=(const Composite& b) {
    inertia += b.inertia;
    rate += b.rate;
    momentum += b.momentum;
    force += b.force;
    return *this;
  }
};

template <>
struct Composite<true> : Composite<false> {
  LaneInertiaRate weight_rate;          // of the inertia, along w
  LaneWrench weight_momentum, response;  // I w, and the covector of dv: rate w - w x* I v

  static Composite zero() {
    return {Composite<false>::zero(), LaneInertiaRate::zero(), LaneWrench::zero(), LaneWrench::zero()};
  }
  Composite& operator+=(const Composite& b) {
    Composite<false>::operator+=(b);
    weight_rate += b.weight_rate;
    weight_momentum += b.weight_momentum;
    response += b.response;
    return *this;
  }
};

template <class F>
EXACTARM_INLINE void each_lanes(Composite<false>& a, const Composite<false>& b, const F& f) {
  exactarm::each_lanes(a.inertia, b.inertia, f);
  exactarm::each_lanes(a.rate, b.rate, f);
  exactarm::each_lanes(a.momentum, b.momentum, f);
  exactarm::each_lanes(a.force, b.force, f);
}

template <class F>
EXACTARM_INLINE void each_lanes(Composite<true>& a, const Composite<true>& b, const F& f) {
  each_lanes(static_cast<Composite<false>&>(a), static_cast<const Composite<false>&>(b), f);
  exactarm::each_lanes(a.weight_rate, b.weight_rate, f);
  exactarm::each_lanes(a.weight_momentum, b.weight_momentum, f);
  exactarm::each_lanes(a.response, b.response, f);
}

// The wrenches of axis k that meet the twists of axes j <= k.
template <bool kSecond>
struct Covectors {
  LaneWrench inertia_joint;  // I S
  LaneWrench coriolis_joint; // 2 B' S, 2 B = rate + (.) x* momentum
  LaneWrench by_q;           // variation of the force by q_k
  LaneWrench by_q_dot;       // variation of the force by qd_k
};

template <>
struct Covectors<true> : Covectors<false> {
  LaneWrench weight_by_q;      // variation of I w by q_k
  LaneWrench response_by_q;    // variation of the response by q_k
  LaneWrench response_by_q_dot;
};

template <class F>
EXACTARM_INLINE void each_lanes(Covectors<false>& a, const Covectors<false>& b, const F& f) {
  exactarm::each_lanes(a.inertia_joint, b.inertia_joint, f);
  exactarm::each_lanes(a.coriolis_joint, b.coriolis_joint, f);
  exactarm::each_lanes(a.by_q, b.by_q, f);
  exactarm::each_lanes(a.by_q_dot, b.by_q_dot, f);
}

template <class F>
EXACTARM_INLINE void each_lanes(Covectors<true>& a, const Covectors<true>& b, const F& f) {
  each_lanes(static_cast<Covectors<false>&>(a), static_cast<const Covectors<false>&>(b), f);
  exactarm::each_lanes(a.weight_by_q, b.weight_by_q, f);
  exactarm::each_lanes(a.response_by_q, b.response_by_q, f);
  exactarm::each_lanes(a.response_by_q_dot, b.response_by_q_dot, f);
}

template <bool kSecond>
EXACTARM_INLINE Composite<kSecond> link_quantities(const LinkLanes& link, const MotionLanes& m) {
  Composite<kSecond> own;
  own.inertia = world_inertia(link.mass, link.centre, link.central, m.pose);
  own.rate = inertia_rate(m.rate, own.inertia);
  own.momentum = own.inertia * m.rate;
  own.force = own.inertia * m.acceleration + cross_dual(m.rate, own.momentum);
  if constexpr (kSecond) {
    own.weight_rate = inertia_rate(m.weight, own.inertia);
    own.weight_momentum = own.inertia * m.weight;
    own.response = own.rate * m.weight - cross_dual(m.weight, own.momentum);
  }
  return own;
}

template <bool kSecond>
EXACTARM_INLINE Covectors<kSecond> covectors(const Composite<kSecond>& c, const MotionLanes& m) {
  const Lanes two(2.0);
  Covectors<kSecond> out;
  const LaneWrench rate_joint = c.rate * m.joint, joint_momentum = cross_dual(m.joint, c.momentum);
  out.inertia_joint = c.inertia * m.joint;
  out.coriolis_joint = rate_joint - joint_momentum;
  out.by_q = c.inertia * m.psi_ddot + c.rate * m.psi_dot + cross_dual(m.psi_dot, c.momentum) +
             cross_dual(m.joint, c.force);
  out.by_q_dot = two * (c.inertia * m.psi_dot) + rate_joint + joint_momentum;
  if constexpr (kSecond) {
    out.weight_by_q = c.inertia * m.chi + cross_dual(m.joint, c.weight_momentum);
    out.response_by_q_dot = cross_dual(m.joint, c.weight_momentum) - c.weight_rate * m.joint;
    out.response_by_q = c.rate * m.chi - cross_dual(m.chi, c.momentum) - c.weight_rate * m.psi_dot +
                        cross_dual(m.psi_dot, c.weight_momentum) + cross_dual(m.joint, c.response);
  }
  return out;
}

// Twists of all axes, and with them v, a, w of all links.
template <class Layout, bool kSecond>
void forward(const Vector3& gravity, DerivativesMemory<Layout>& memory) {
  LaneTwist rate = LaneTwist::zero(), weight = LaneTwist::zero();
  LaneTwist acceleration{LaneVec::zero(), spatial::constant<Lanes>(-gravity)};
  const std::size_t blocks = memory.motion.size();
  for (std::size_t b = 0; b < blocks; ++b) {
    const LinkLanes& link = memory.links[b];
    MotionLanes& m = memory.motion[b];
    const LaneVec turn = link.turn * m.pose.z;
    m.joint = {turn, cross(m.pose.origin, turn) + link.slide * m.pose.z};
    Layout::inboard(memory.q_dot[b] * m.joint, rate);
    m.rate = rate;
    m.psi_dot = cross(rate, m.joint);
    Layout::inboard(memory.q_ddot[b] * m.joint + memory.q_dot[b] * m.psi_dot, acceleration);
    m.acceleration = acceleration;
    m.psi_ddot = cross(acceleration, m.joint) + cross(rate, m.psi_dot);
    if constexpr (kSecond) {
      Layout::inboard(memory.lambda[b] * m.joint, weight);
      m.weight = weight;
      m.chi = cross(weight, m.joint);
    }
  }
}

// Where the entries go, for every pair of an axis k and a block of axes j <= k: `row` holds (k, j), `column`
// (j, k). With samples in the lanes these are n x n matrices of lanes, column major; with axes in the lanes,
// lane j of entry [k * blocks + block], which `assemble` puts in order afterwards.
template <class Layout>
struct Entries {
  int n, blocks;
  Lanes* rows[kMatrices];
  Lanes* columns[kMatrices];

  Entries(int axes, Lanes* memory) : n(axes), blocks(Layout::blocks(axes)) {
    for (int result = 0; result < kMatrices; ++result) {
      rows[result] = memory + 2 * result * matrix_size(n);
      columns[result] = rows[result] + matrix_size(n);
    }
  }
  static int matrix_size(int n) { return padded(padded(n) * Layout::blocks(n)); }
  static int size(int n) { return 2 * kMatrices * matrix_size(n); }

  EXACTARM_INLINE void put(Result result, int k, int block, const Lanes& row, const Lanes& column) const {
    if constexpr (Layout::kAxesABlock == 1) {
      rows[result][n * block + k] = row;
      rows[result][n * k + block] = column;
    } else {
      rows[result][blocks * k + block] = row;
      columns[result][blocks * k + block] = column;
    }
  }
  EXACTARM_INLINE void put(Result result, int k, int block, const Lanes& both) const {
    put(result, k, block, both, both);
  }
};

// One n x n matrix, column major, from its tiles of 8 x 8: on and above the diagonal the columns as they are,
// below it the rows, transposed in place.
void assemble(const Entries<AxesInLanes>& from, int result, double* to) {
  constexpr int kTile = Lanes::kCount;
  const int n = from.n, blocks = from.blocks;
  Lanes* const rows = from.rows[result];
  for (int block = 0; block < blocks; ++block)
    for (int column_block = 0; column_block <= block; ++column_block) {
      Lanes tile[kTile], turned[kTile];
      for (int i = 0; i < kTile; ++i) tile[i] = rows[blocks * (kTile * block + i) + column_block];
      transpose(tile, turned);
      for (int i = 0; i < kTile; ++i) rows[blocks * (kTile * block + i) + column_block] = turned[i];
    }
  const Lanes::Native place = {0, 1, 2, 3, 4, 5, 6, 7};
  for (int column = 0; column < n; ++column)
    for (int block = 0; block < blocks; ++block) {
      const int lane = column - kTile * block;  // above 7: the tile lies above the diagonal
      const Lanes::Native below = rows[blocks * (kTile * block + column % kTile) + column / kTile].v;
      const Lanes::Native above = from.columns[result][blocks * column + block].v;
      const Lanes::Native values = place <= lane ? above : below;
      double* target = to + n * column + kTile * block;
      // What a whole store leaves behind the matrix' end of column is overwritten by the next column.
      const bool whole = n * column + kTile * (block + 1) <= n * n;
      __builtin_memcpy(target, &values, whole ? sizeof values : (n - kTile * block) * sizeof(double));
    }
}

template <class Layout, bool kSecond>
EXACTARM_INLINE void meet(const Covectors<kSecond>& c, const MotionLanes& m, int k, int block,
                          const Entries<Layout>& to) {
  const Lanes two(2.0);
  to.put(kMass, k, block, dot(m.joint, c.inertia_joint));
  to.put(kDtauDq, k, block, dot(m.psi_ddot, c.inertia_joint) + dot(m.psi_dot, c.coriolis_joint),
         dot(m.joint, c.by_q));
  to.put(kDtauDqDot, k, block, two * dot(m.psi_dot, c.inertia_joint) + dot(m.joint, c.coriolis_joint),
         dot(m.joint, c.by_q_dot));
  if constexpr (kSecond) {
    to.put(kQQ, k, block,
           dot(m.psi_ddot, c.weight_by_q) + dot(m.psi_dot, c.response_by_q) + dot(m.chi, c.by_q));
    to.put(kQQDot, k, block, two * dot(m.psi_dot, c.weight_by_q) + dot(m.joint, c.response_by_q),
           dot(m.chi, c.by_q_dot) + dot(m.psi_dot, c.response_by_q_dot));
    to.put(kQDotQDot, k, block, dot(m.joint, c.response_by_q_dot));
    to.put(kQQDdot, k, block, dot(m.joint, c.weight_by_q), dot(m.chi, c.inertia_joint));
  }
}

template <class Layout, bool kSecond>
void backward(const DerivativesMemory<Layout>& memory, const Entries<Layout>& to, Lanes* torque) {
  Composite<kSecond> composite = Composite<kSecond>::zero();
  for (int b = static_cast<int>(memory.motion.size()) - 1; b >= 0; --b) {
    const MotionLanes& m = memory.motion[b];
    Layout::outboard(link_quantities<kSecond>(memory.links[b], m), composite);
    const Covectors<kSecond> block = covectors<kSecond>(composite, m);
    torque[b] = dot(m.joint, composite.force);
    const int first = Layout::kAxesABlock * b, end = std::min(to.n, first + Layout::kAxesABlock);
    for (int k = first; k < end; ++k) {
      const Covectors<kSecond>& axis = Layout::of_axis(block, k - first);
      for (int inner = 0; inner <= b; ++inner)
        meet<Layout, kSecond>(axis, memory.motion[inner], k, inner, to);
    }
  }
}

void set_axis(LinkLanes& link, const DynamicsAxis& axis, int lane) {
  (axis.revolute ? link.turn : link.slide).set(lane, axis.sign);
  link.mass.set(lane, axis.mass);
  int k = 0;
  each_lanes(link.centre, link.centre,
             [&](Lanes& x, const Lanes&) { x.set(lane, axis.centre_of_mass[k++]); });
  const auto central = spatial::constant_symmetric<double>(axis.central_inertia);
  const double values[] = {central.xx, central.xy, central.xz, central.yy, central.yz, central.zz};
  k = 0;
  each_lanes(link.central, link.central, [&](Lanes& x, const Lanes&) { x.set(lane, values[k++]); });
}

void set_pose(AxisPose<Lanes>& block, const AxisPose<double>& pose, int lane) {
  const spatial::Vec3<double>* const from[] = {&pose.x, &pose.y, &pose.z, &pose.origin};
  LaneVec* const to[] = {&block.x, &block.y, &block.z, &block.origin};
  for (int k = 0; k < 4; ++k) {
    to[k]->x.set(lane, from[k]->x);
    to[k]->y.set(lane, from[k]->y);
    to[k]->z.set(lane, from[k]->z);
  }
}

template <bool kSecond>
void one_sample(const DynamicsModel& model, DerivativesWorkspace& w, ConstVectorRef q, ConstVectorRef q_dot,
                ConstVectorRef q_ddot, const double* lambda, DynamicsDerivatives& out) {
  const int n = model.size();
  axis_angles(model, q.data(), w.angle.data(), w.sine.data(), w.cosine.data());
  axis_poses(model, q.data(), w.sine.data(), w.cosine.data(), w.pose.data());
  for (int i = 0; i < n; ++i) {
    const int block = i / Lanes::kCount, lane = i % Lanes::kCount;
    set_pose(w.motion[block].pose, w.pose[i], lane);
    w.q_dot[block].set(lane, q_dot[i]);
    w.q_ddot[block].set(lane, q_ddot[i]);
    if constexpr (kSecond) w.lambda[block].set(lane, lambda[i]);
  }
  forward<AxesInLanes, kSecond>(model.gravity, w);
  const Entries<AxesInLanes> entries(n, w.results.data());
  backward<AxesInLanes, kSecond>(w, entries, w.torque.data());
  for (int i = 0; i < n; ++i) out.tau[i] = w.torque[i / Lanes::kCount][i % Lanes::kCount];
  double* const to[kMatrices] = {out.dtau_dq.data(), out.dtau_dq_dot.data(), out.mass_matrix.data(),
                                 out.q_q.data(),     out.q_q_dot.data(),     out.q_dot_q_dot.data(),
                                 out.q_q_ddot.data()};
  for (int k = 0; k < (kSecond ? kMatrices : kQQ); ++k) assemble(entries, k, to[k]);
}

template <bool kSecond>
void eight_knots(const DynamicsModel& model, KnotWorkspace& w, const KnotBatch& batch, long knot, long end) {
  const int n = model.size();
  load_rows(batch.q, n, knot, end, n, w.q.data());
  load_rows(batch.q_dot, n, knot, end, n, w.q_dot.data());
  load_rows(batch.q_ddot, n, knot, end, n, w.q_ddot.data());
  if constexpr (kSecond) load_rows(batch.lambda, n, knot, end, n, w.lambda.data());
  axis_angles(model, w.q.data(), w.angle.data(), w.sine.data(), w.cosine.data());
  axis_poses(model, w.q.data(), w.sine.data(), w.cosine.data(), w.pose.data());
  for (int i = 0; i < n; ++i) w.motion[i].pose = w.pose[i];
  forward<SamplesInLanes, kSecond>(model.gravity, w);
  const Entries<SamplesInLanes> entries(n, w.results.data());
  backward<SamplesInLanes, kSecond>(w, entries, w.torque.data());
  if (batch.tau) store_rows(w.torque.data(), n, knot, end, n, batch.tau);
  double* const to[kMatrices] = {batch.dtau_dq, batch.dtau_dq_dot, batch.mass_matrix, batch.q_q,
                                 batch.q_q_dot, batch.q_dot_q_dot, batch.q_q_ddot};
  for (int k = 0; k < (kSecond ? kMatrices : kQQ); ++k)
    if (to[k]) store_rows(entries.rows[k], n * n, knot, end, n * n, to[k]);
}

}  // namespace

DynamicsDerivatives::DynamicsDerivatives(int axes)
    : tau(Vector::Zero(axes)), dtau_dq(Matrix::Zero(axes, axes)), dtau_dq_dot(dtau_dq), mass_matrix(dtau_dq),
      q_q(dtau_dq), q_q_dot(dtau_dq), q_dot_q_dot(dtau_dq), q_q_ddot(dtau_dq) {}

template <class Layout>
DerivativesMemory<Layout>::DerivativesMemory(const DynamicsModel& model) {
  const int n = model.size(), blocks = Layout::blocks(n);
  const Lanes none(0.0);
  links.assign(blocks, LinkLanes{none, none, none, LaneVec::zero(), spatial::Sym3<Lanes>::zero()});
  for (int i = 0; i < n; ++i)
    if constexpr (Layout::kAxesABlock == 1)
      for (int lane = 0; lane < Lanes::kCount; ++lane) set_axis(links[i], model.axes[i], lane);
    else
      set_axis(links[i / Lanes::kCount], model.axes[i], i % Lanes::kCount);
  const AxisPose<Lanes> nowhere{LaneVec::zero(), LaneVec::zero(), LaneVec::zero(), LaneVec::zero()};
  motion.assign(
      blocks, MotionLanes{nowhere, LaneTwist::zero(), LaneTwist::zero(), LaneTwist::zero(), LaneTwist::zero(),
                          LaneTwist::zero(), LaneTwist::zero(), LaneTwist::zero()});
  for (auto* values : {&q_dot, &q_ddot, &lambda}) values->assign(blocks, none);
  for (auto* values : {&q, &angle, &sine, &cosine}) values->assign(n, typename Layout::Value(0.0));
  pose.resize(n);
  torque.assign(padded(blocks), none);
  results.assign(Entries<Layout>::size(n), none);
}

template struct DerivativesMemory<AxesInLanes>;
template struct DerivativesMemory<SamplesInLanes>;

void inverse_dynamics_derivatives(const DynamicsModel& model, DerivativesWorkspace& workspace,
                                  ConstVectorRef q, ConstVectorRef q_dot, ConstVectorRef q_ddot,
                                  DynamicsDerivatives& out) {
  one_sample<false>(model, workspace, q, q_dot, q_ddot, nullptr, out);
}

void inverse_dynamics_second_derivatives(const DynamicsModel& model, DerivativesWorkspace& workspace,
                                         ConstVectorRef q, ConstVectorRef q_dot, ConstVectorRef q_ddot,
                                         ConstVectorRef lambda, DynamicsDerivatives& out) {
  one_sample<true>(model, workspace, q, q_dot, q_ddot, lambda.data(), out);
}

Matrix coriolis_matrix(const Robot& robot, ConstVectorRef q, ConstVectorRef q_dot) {
  require_size("q", q.size(), robot.axes());
  require_size("q_dot", q_dot.size(), robot.axes());
  const DynamicsModel model(robot);
  DerivativesWorkspace workspace(model);
  DynamicsDerivatives out(model.size());
  inverse_dynamics_derivatives(model, workspace, q, q_dot, Vector::Zero(model.size()), out);
  return 0.5 * out.dtau_dq_dot;
}

void inverse_dynamics_knots(const DynamicsModel& model, KnotWorkspace& workspace, const KnotBatch& batch,
                            long first, long last) {
  for (long knot = first; knot < last; knot += Lanes::kCount)
    if (batch.lambda)
      eight_knots<true>(model, workspace, batch, knot, last);
    else
      eight_knots<false>(model, workspace, batch, knot, last);
}

void inverse_dynamics_knots(const DynamicsModel& model, const KnotBatch& batch, int threads) {
  parallel_rows(batch.knots, threads, kLeastKnotsAThread, [&](long begin, long end) {
    KnotWorkspace workspace(model);
    inverse_dynamics_knots(model, workspace, batch, begin, end);
  });
}

}  // namespace exactarm
