// The panel of a review: a line of time, and what happened on it.
#pragma once

#include <optional>

#include <rviz/panel.h>

#ifndef Q_MOC_RUN
#include <meshless_surgery/Bookmarks.h>
#include <meshless_surgery/Review.h>
#include <meshless_surgery/Surfaces.h>

#include "node_link.h"
#endif

class QComboBox;
class QLabel;
class QLineEdit;
class QListWidget;
class QPushButton;
class QSlider;

namespace meshless {

class ReviewPanel : public rviz::Panel {
  Q_OBJECT

 public:
  explicit ReviewPanel(QWidget* parent = nullptr);

  void load(const rviz::Config& config) override;
  void save(rviz::Config config) const override;

 private Q_SLOTS:
  void changeNodes();

 private:
  void show(const meshless_surgery::Review& review);
  void list(const meshless_surgery::Bookmarks& bookmarks);
  /// Turns the view to the bodies.
  void face(const meshless_surgery::Surfaces& surfaces);
  /// Of all nodes.
  void seek(double time);
  void seekNext();
  void play(double speed);
  void say(const QString& text);

  QLineEdit* nodes_;
  QPushButton* play_;
  QComboBox* speed_;
  QSlider* slider_;
  QLabel* time_;
  QListWidget* bookmarks_;
  QLabel* message_;
  std::vector<NodeLink*> links_;                // of the first node the time is shown
  ros::Subscriber review_, events_, surfaces_;  // the last one until a view faces them
  double now_ = 0.0, length_ = 0.0, plays_ = 0.0;
  int asked_ = 0;                 // answers that are still to come
  std::optional<double> wanted_;  // meanwhile
};

}  // namespace meshless
