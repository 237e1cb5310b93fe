#include "planner_offline/contacts/contact_table.hpp"

#include <algorithm>
#include <vector>

namespace clamber {
namespace {

using Column = std::vector<std::string>;

Column column_of(const ContactState& state, std::size_t number) {
  Column column{"State" + std::to_string(number)};
  for (const ContactReference& contact : state.obstacle) {
    column.push_back(contact.link);
  }
  for (const ContactReference& contact : state.floor) {
    column.push_back("(" + contact.link + ")");
  }
  return column;
}

std::size_t width_of(const Column& column) {
  std::size_t width = 0;
  for (const std::string& cell : column) {
    width = std::max(width, cell.size());
  }
  return width;
}

}  // namespace

std::string contact_table(std::span<const ContactState> states) {
  std::vector<Column> columns;
  std::size_t rows = 0;
  for (const ContactState& state : states) {
    columns.push_back(column_of(state, columns.size() + 1));
    rows = std::max(rows, columns.back().size());
  }
  for (std::size_t i = 0; i < columns.size(); ++i) {
    columns[i].resize(rows);
    columns[i].push_back(states[i].stability > 0.0 ? "s > 0" : "s = 0");
  }
  std::string table;
  for (std::size_t row = 0; !columns.empty() && row <= rows; ++row) {
    std::string line;
    for (const Column& column : columns) {
      line += column[row];
      line.append(width_of(column) + 3 - column[row].size(), ' ');
    }
    table += line.substr(0, line.find_last_not_of(' ') + 1) + '\n';
  }
  return table;
}

}  // namespace clamber
