// Live rows from `clamber web`. The browser reconnects by itself; what the server still holds of the
// time between comes with the new connection.
import { Run, floatsOfBase64 } from "./run.js";

/**
 * @param on {run(Run), rows(Run), story(Run), lost(), note(text)}
 */
export function listen(on) {
  let run;
  connect();

  function connect() {
    const events = new EventSource("live");
    events.addEventListener("scene", (event) => introduce(JSON.parse(event.data)));
    events.addEventListener("rows", (event) => {
      run.append(floatsOfBase64(event.data));
      on.rows(run);
    });
    events.addEventListener("story", (event) => {
      run.story = JSON.parse(event.data);
      on.story(run);
    });
    events.addEventListener("note", (event) => on.note(event.data));
    events.onerror = () => {
      on.lost();
      // Refused, which the browser takes for final: too many watch.
      if (events.readyState === EventSource.CLOSED) setTimeout(connect, 2000);
    };
  }

  function introduce({ scene, layout, session }) {
    // The same session after a short break goes on where it was.
    if (run?.session === session) return;
    run = new Run(scene, layout);
    run.session = session;
    on.run(run);
  }
}
