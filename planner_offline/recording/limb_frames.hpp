// Segment orientations from joint positions: inverse kinematics on a human skeleton.
// Start-up only: allocates, throws InputError, never blocks.
#pragma once

#include "planner_offline/recording/human_motion.hpp"

namespace clamber {

/// Gives a motion that has only points the segments Pelvis, T8, upper arms, forearms, hands, upper
/// legs, lower legs, feet and toes, in the anatomical frames that MVNX recordings have.
///
/// Points wanted: Hips, Spine, Spine1, Neck and for Left and Right: Arm (shoulder), ForeArm
/// (elbow), Hand (wrist), UpLeg (hip), Leg (knee), Foot (ankle), ToeBase.
///
/// - Pelvis: y along the hip line, z towards Spine. Chest: y along the shoulder line, z from
///   Spine1 to Neck.
/// - Limbs: z along the bone; the hinge axis y is the normal of the elbow's or knee's bending
///   plane, which fixes the twist of the upper segment. Below 25 deg of flexion the plane fades
///   out, and below 10 deg the axis of the frame before is carried on (in the first frame: the
///   parent's).
/// - Feet: x along ankle to toe joint, less the slope which that line has when the foot stands
///   flat; a foot's roll follows the shank.
/// Forearm pronation cannot be seen in points and is zero.
/// @throws InputError naming the missing point or the frame whose joints coincide
void add_segments(HumanMotion& motion);

}  // namespace clamber
