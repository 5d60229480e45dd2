// A click on a heading of a table sorts its rows by that column; a second click turns the order round.
document.querySelectorAll("table.sortable").forEach((table) => {
  const headings = [...table.tHead.rows[0].cells];
  headings.forEach((heading, column) => {
    heading.querySelector("button").addEventListener("click", () => {
      const sign = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      const key = (row) => {
        const cell = row.cells[column];
        return cell.dataset.value === undefined ? cell.textContent.trim() : Number(cell.dataset.value);
      };
      const numbers = heading.classList.contains("number");
      const compare = (a, b) => {
        const [one, other] = [key(a), key(b)];
        // what has no number comes last, in either order
        if (numbers && typeof one !== typeof other) return typeof one === "number" ? -1 : 1;
        return sign * (numbers && typeof one === "number" ? one - other : String(one).localeCompare(String(other)));
      };
      const body = table.tBodies[0];
      [...body.rows].sort(compare).forEach((row) => body.append(row));
      headings.forEach((other) => other.removeAttribute("aria-sort"));
      heading.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
    });
  });
});
