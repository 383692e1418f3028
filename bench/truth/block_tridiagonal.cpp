#include "block_tridiagonal.h"

namespace meshless::truth {

BlockTridiagonal::BlockTridiagonal(int layers, int layer_size) : layer_size_(layer_size) {
  const int blocks = (layers - 1) / 2;
  for (int block = 0; block < blocks; ++block) {
    const int size = (block == 0 ? 3 : 2) * layer_size;
    diagonal_.emplace_back(size, size);
    coupling_.emplace_back(block == 0 ? 0 : layer_size, size);
  }
}

void BlockTridiagonal::setZero() {
  for (Eigen::MatrixXd& block : diagonal_) {
    block.setZero();
  }
  for (Eigen::MatrixXd& block : coupling_) {
    block.setZero();
  }
}

int BlockTridiagonal::blockOf(int row) const {
  const int layer = row / layer_size_;
  return layer <= 2 ? 0 : (layer - 1) / 2;
}

void BlockTridiagonal::add(int row, int column, double value) {
  if (column > row) {
    return;
  }
  const int block = blockOf(row);
  if (blockOf(column) == block) {
    diagonal_[block](row - offset(block), column - offset(block)) += value;
  } else {
    coupling_[block](column - (offset(block) - layer_size_), row - offset(block)) += value;
  }
}

double BlockTridiagonal::diagonal(int row) const {
  const int block = blockOf(row);
  return diagonal_[block](row - offset(block), row - offset(block));
}

bool BlockTridiagonal::factor() {
  for (std::size_t block = 0; block < diagonal_.size(); ++block) {
    Eigen::MatrixXd& d = diagonal_[block];
    if (block > 0) {
      const auto last = diagonal_[block - 1].bottomRightCorner(layer_size_, layer_size_);
      last.triangularView<Eigen::Lower>().solveInPlace(coupling_[block]);
      d.selfadjointView<Eigen::Lower>().rankUpdate(coupling_[block].transpose(), -1.0);
    }
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> cholesky(d);
    if (cholesky.info() != Eigen::Success) {
      return false;
    }
  }
  return true;
}

Eigen::VectorXd BlockTridiagonal::solve(const Eigen::VectorXd& right_hand_side) const {
  Eigen::VectorXd x = right_hand_side;
  const int blocks = static_cast<int>(diagonal_.size());
  for (int block = 0; block < blocks; ++block) {
    auto part = x.segment(offset(block), diagonal_[block].rows());
    if (block > 0) {
      part -= coupling_[block].transpose() * x.segment(offset(block) - layer_size_, layer_size_);
    }
    diagonal_[block].triangularView<Eigen::Lower>().solveInPlace(part);
  }
  for (int block = blocks - 1; block >= 0; --block) {
    auto part = x.segment(offset(block), diagonal_[block].rows());
    if (block + 1 < blocks) {
      part.tail(layer_size_) -= coupling_[block + 1] * x.segment(offset(block + 1), diagonal_[block + 1].rows());
    }
    diagonal_[block].triangularView<Eigen::Lower>().transpose().solveInPlace(part);
  }
  return x;
}

}  // namespace meshless::truth
