#include "planner_offline/search/stretch.hpp"

#include <algorithm>

namespace clamber {
namespace {

void move(ContactSet& contacts, const Pose& X) {
  for (Contact& contact : contacts) {
    contact.anchor = X * contact.anchor;
    contact.slip = (X.R * Eigen::Vector3d(contact.slip.x(), contact.slip.y(), 0.0)).head<2>();
  }
}

}  // namespace

Configuration between(const Configuration& a, const Configuration& b, double t) {
  Configuration x;
  x.q = a.q + t * (b.q - a.q);
  x.X_WB.p = a.X_WB.p + t * (b.X_WB.p - a.X_WB.p);
  x.X_WB.R = a.X_WB.R * rotation_exp(t * rotation_log(a.X_WB.R.transpose() * b.X_WB.R));
  return x;
}

const ContactSet& carrying(const Stretch& stretch) {
  const bool unloads = stretch.kind == Stretch::Kind::kLoad &&
                       stretch.next_contacts.size() < stretch.contacts.size();
  return unloads ? stretch.next_contacts : stretch.contacts;
}

std::vector<Stretch> joined(std::vector<Stretch> stretches) {
  for (std::size_t i = 0; i + 1 < stretches.size(); ++i) {
    if (stretches[i].kind != Stretch::Kind::kLoad) {
      continue;
    }
    for (Contact& contact : stretches[i].next_contacts) {
      for (const Contact& held : stretches[i + 1].contacts) {
        if (held.link == contact.link) {
          contact.mode = held.mode;
        }
      }
    }
  }
  return stretches;
}

std::vector<Stretch> reversed(const std::vector<Stretch>& stretches) {
  std::vector<Stretch> back(stretches.rbegin(), stretches.rend());
  for (Stretch& stretch : back) {
    stretch.name = "back: " + stretch.name;
    std::reverse(stretch.path.begin(), stretch.path.end());
    if (stretch.kind == Stretch::Kind::kLoad) {
      std::swap(stretch.contacts, stretch.next_contacts);
    }
  }
  return back;
}

std::vector<Stretch> moved(std::vector<Stretch> stretches, const Pose& X) {
  for (Stretch& stretch : stretches) {
    for (Configuration& x : stretch.path) {
      x.X_WB = X * x.X_WB;
    }
    move(stretch.contacts, X);
    move(stretch.next_contacts, X);
  }
  return stretches;
}

}  // namespace clamber
