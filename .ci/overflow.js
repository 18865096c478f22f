// Tells the frame around a page what does not fit into its width: "nothing", or an element a line. Folded content is opened first.
addEventListener("load", () => {
  document.querySelectorAll("details").forEach((details) => { details.open = true; });
  const width = document.documentElement.clientWidth;
  const name = (element) => {
    const own = element.id ? `#${element.id}` : element.getAttribute("class") ? `.${element.getAttribute("class")}` : "";
    const within = element.closest("[id]");
    const words = element.textContent.trim().replace(/\s+/g, " ").slice(0, 40);
    return `${element.tagName.toLowerCase()}${own}${within ? ` in #${within.id}` : ""} "${words}"`;
  };
  // What scrolls within a box can be reached; what is cut by one cannot.
  const scrolls = (element) => ["auto", "scroll"].includes(getComputedStyle(element).overflowX);
  const around = (element) => element.parentElement && (scrolls(element.parentElement) ? element.parentElement : around(element.parentElement));
  const isShown = (element) => element.getClientRects().length > 0 && !element.closest("thead:is(.cards thead)");
  const found = [];
  if (document.documentElement.scrollWidth > width) {
    found.push(`the page: ${document.documentElement.scrollWidth} of ${width} px`);
  }
  for (const element of document.body.querySelectorAll("*:not(svg *)")) {
    if (!isShown(element) || around(element)) continue;
    const { left, right } = element.getBoundingClientRect();
    if (left < -0.5 || right > width + 0.5) {
      found.push(`${name(element)}: from ${left.toFixed(0)} to ${right.toFixed(0)} px`);
    } else if (element.scrollWidth > element.clientWidth + 1 && element.clientWidth > 0 && !scrolls(element)) {
      found.push(`${name(element)}: content of ${element.scrollWidth} px in ${element.clientWidth} px`);
    }
  }
  // On a desk, every table that is not folded fits; the long ones of single items scroll, and so do tables on a telephone.
  for (const box of document.body.querySelectorAll(".scroll:not(details .scroll)")) {
    if (width > 1000 && box.scrollWidth > box.clientWidth + 1) {
      found.push(`${name(box)}: a table of ${box.scrollWidth} px scrolls in ${box.clientWidth} px`);
    }
  }
  // Words of a figure end at its edge.
  for (const text of document.body.querySelectorAll("svg text")) {
    const [own, frame] = [text.getBoundingClientRect(), text.closest("svg").getBoundingClientRect()];
    if (own.width > 0 && (own.left < frame.left - 1 || own.right > frame.right + 1)) {
      found.push(`${name(text)}: from ${(own.left - frame.left).toFixed(0)} to ${(own.right - frame.left).toFixed(0)} of ${frame.width.toFixed(0)} px`);
    }
  }
  parent.postMessage(found.length ? found.join("\n") : "nothing", "*");
});
