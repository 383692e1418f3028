// A bar for the force of each hand: instruments, and picks that a hand holds.
#pragma once

#include <vector>

#include <meshless_surgery/State.h>
#include <QString>
#include <QWidget>

class QFormLayout;
class QProgressBar;

namespace meshless {

struct HandForce {
  QString name;
  double force = 0.0;  // [N]
  QString holds;       // body between its jaws, or that it pulls; empty: none
  double grip = 0.0;   // [N] with which jaws press it
};

/// In the order of the message, instruments first. Picks that are locked have no hand.
std::vector<HandForce> handForces(const meshless_surgery::State& state);

/// "1.25 N, grips liver with 3.4 N"
QString forceText(const HandForce& hand);

class HandBars : public QWidget {
 public:
  explicit HandBars(QWidget* parent);
  /// full: [N] from which a bar is full, and red.
  void show(const std::vector<HandForce>& hands, double full);

 private:
  QFormLayout* form_;
  std::vector<QProgressBar*> bars_;
};

}  // namespace meshless
