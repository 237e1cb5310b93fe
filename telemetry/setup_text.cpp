#include "telemetry/setup_text.hpp"

#include <nlohmann/json.hpp>

#include "robot_model/loader.hpp"

namespace clamber {

using Json = nlohmann::json;

std::string format_setup(const TelemetrySetup& setup) {
  const TelemetryConfig& c = setup.config;
  const TelemetryDescription& d = setup.description;
  Json json{{"domain", c.domain},
            {"interfaces", c.interfaces},
            {"robot", c.robot},
            {"security", c.security},
            {"joint_names", d.joint_names},
            {"torque_limits", d.torque_limits},
            {"contact_names", d.contact_names},
            {"dt", d.dt},
            {"plan", d.plan},
            {"modes", d.modes},
            {"faults", d.faults},
            {"base", d.base},
            {"urdf", d.urdf},
            {"phases", Json::array()},
            {"links", Json::array()}};
  for (const DescribedPhase& phase : d.phases)
    json["phases"].push_back(Json::array({phase.name, phase.contacts}));
  for (const DescribedLink& link : d.links)
    json["links"].push_back(Json::array(
        {link.name, link.parent, link.joint, link.position, link.orientation, link.axis}));
  // A robot file's bytes need not be UTF-8.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

TelemetrySetup parse_setup(std::string_view text) {
  try {
    const Json json = Json::parse(text);
    TelemetrySetup setup;
    TelemetryConfig& c = setup.config;
    json.at("domain").get_to(c.domain);
    json.at("interfaces").get_to(c.interfaces);
    json.at("robot").get_to(c.robot);
    json.at("security").get_to(c.security);
    TelemetryDescription& d = setup.description;
    json.at("joint_names").get_to(d.joint_names);
    json.at("torque_limits").get_to(d.torque_limits);
    json.at("contact_names").get_to(d.contact_names);
    json.at("dt").get_to(d.dt);
    json.at("plan").get_to(d.plan);
    json.at("modes").get_to(d.modes);
    json.at("faults").get_to(d.faults);
    json.at("base").get_to(d.base);
    json.at("urdf").get_to(d.urdf);
    for (const Json& phase : json.at("phases"))
      d.phases.push_back({phase.at(0).get<std::string>(), phase.at(1).get<std::uint32_t>()});
    for (const Json& link : json.at("links"))
      d.links.push_back({.name = link.at(0),
                         .parent = link.at(1),
                         .joint = link.at(2),
                         .position = link.at(3),
                         .orientation = link.at(4),
                         .axis = link.at(5)});
    return setup;
  } catch (const Json::exception& error) {
    throw InputError(std::string("telemetry: the publisher's setup: ") + error.what());
  }
}

}  // namespace clamber
