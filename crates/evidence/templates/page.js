const filter = document.getElementById("filter"), broken = document.getElementById("broken");
const rows = [...document.querySelectorAll("tr.row")];
const show = () => {
  const words = filter.value.toLowerCase().split(" ").filter(Boolean);
  for (const row of rows) {
    const text = row.textContent.toLowerCase();
    row.hidden = !words.every((word) => text.includes(word)) || (broken.checked && !row.classList.contains("bad"));
  }
};
filter.addEventListener("input", show);
broken.addEventListener("input", show);
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => (part.open = true)));
