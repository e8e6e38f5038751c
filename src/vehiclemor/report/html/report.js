"use strict";
// A link to something inside of closed details opens them, in browsers that don't by themselves.
function reveal() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const closed = target && target.closest("details:not([open])");
  if (closed) { closed.open = true; target.scrollIntoView(); }
}
addEventListener("hashchange", reveal);
reveal();
// Plots are drawn when they come near the window.
const watcher = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) {
    if (!isIntersecting) continue;
    watcher.unobserve(target);
    const data = document.querySelector(`script[data-for="${target.id}"]`);
    Bokeh.embed.embed_item(JSON.parse(data.textContent), target.id);
  }
}, { rootMargin: "600px" });
document.querySelectorAll(".plot").forEach((element) => watcher.observe(element));
