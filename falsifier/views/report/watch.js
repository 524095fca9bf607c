"use strict";
// Asks for what has changed and puts it in place; what a reader has unfolded stays so.
const live = document.getElementById("live");
let seen = "";

async function look() {
  let wait = 1000;
  try {
    const reply = await fetch("live" + location.search, { headers: { "If-None-Match": seen } });
    if (reply.status === 200) {
      const unfolded = new Set([...live.querySelectorAll("details[open] > summary")].map((e) => e.textContent));
      live.innerHTML = await reply.text();
      for (const summary of live.querySelectorAll("details > summary")) {
        if (unfolded.has(summary.textContent)) summary.parentElement.open = true;
      }
      seen = reply.headers.get("ETag");
      if (reply.headers.get("X-Unread")) wait = 50;
    }
    document.documentElement.dataset.state = "connected";
  } catch {
    document.documentElement.dataset.state = "lost";
    wait = 3000;
  }
  setTimeout(look, wait);
}

document.addEventListener("click", (event) => {
  const button = event.target.closest("button[data-token]");
  if (button) {
    button.disabled = true;
    fetch("stop", { method: "POST", headers: { "X-Token": button.dataset.token } });
  }
});
look();
