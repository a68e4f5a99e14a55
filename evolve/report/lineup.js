// The slider selects the card of the best animal after a generation. Without this script, all cards are shown.
"use strict";
document.querySelectorAll(".lineup").forEach((root) => {
  const slider = root.querySelector("input[type=range]");
  if (!slider) return;
  const cards = [...slider.closest("div").querySelectorAll(".card")];
  const said = root.querySelector("output");
  function show() {
    cards.forEach((card, i) => { card.hidden = i !== Number(slider.value); });
    said.textContent = cards[Number(slider.value)].dataset.generation;
    slider.setAttribute("aria-valuetext", "generation " + said.textContent);
    root.dataset.shown = slider.value;
  }
  slider.addEventListener("input", show);
  show();
});
