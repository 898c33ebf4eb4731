/* Frames follow the theme of the page, which its button changes. */
document.addEventListener("DOMContentLoaded", () => {
  const system = window.matchMedia("(prefers-color-scheme: dark)");
  for (const frame of document.querySelectorAll("iframe.moving")) {
    const send = () => {
      const chosen = document.body.dataset.theme;
      const dark = chosen === "dark" || (chosen !== "light" && system.matches);
      frame.contentWindow.postMessage(dark ? "dark" : "light", "*");
    };
    frame.addEventListener("load", send);
    system.addEventListener("change", send);
    new MutationObserver(send).observe(document.body, { attributeFilter: ["data-theme"] });
    send();
  }
});
