// Live rows from `clamber web`. The browser reconnects by itself; what the server still holds of the
// time between comes with the new connection.
import { Run, floatsOfBase64 } from "./run.js";

/**
 * @param on {run(Run), rows(Run), lost(), note(text)}
 */
export function listen(on) {
  const events = new EventSource("live");
  let run;
  events.addEventListener("scene", (event) => {
    const { scene, layout, session } = JSON.parse(event.data);
    // The same session after a short break goes on where it was.
    if (run?.session !== session) {
      run = new Run(scene, layout);
      run.session = session;
      on.run(run);
    }
    on.note("");
  });
  events.addEventListener("rows", (event) => {
    run.append(floatsOfBase64(event.data));
    on.rows(run);
  });
  events.addEventListener("note", (event) => on.note(event.data));
  events.onerror = () => on.lost();
}
