"""Files of labs that write in other alphabets: stamps, columns, encodings."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.reading.moments.stamps import parse_stamps

MINUTES = np.arange(0.0, 121.0)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("2026/11/28 午前 11:05:03", "2026/11/28 午後 0:05:03"),  # noon, as Japanese programs have it
        ("28/11/2026 10:05:03 πμ", "28/11/2026 11:05:03 πμ"),
        ("28/11/2026 11:05:03 π.μ.", "28/11/2026 12:05:03 μ.μ."),
        ("28.11.2026 ÖÖ 11:05:03", "28.11.2026 ÖS 12:05:03"),
        ("2026-11-28 凌晨1:05:03", "2026-11-28 凌晨2:05:03"),
        ("2026-11-28 早上11:05:03", "2026-11-28 中午12:05:03"),
        ("2026-11-28 下午1:05:03", "2026-11-28 下午2:05:03"),
        ("28 ноября 2026 г. 10:05:03", "28 ноября 2026 г. 11:05:03"),
        ("28 Νοε 2026 10:05:03", "28 Νοε 2026 11:05:03"),
        ("令和8年11月28日 10:05:03", "令和8年11月28日 11:05:03"),
        ("民國115年11月28日 10:05:03", "民國115年11月28日 11:05:03"),
    ],
)
def test_stamps_of_other_languages(first, second):
    assert parse_stamps([first, second], "time", [2, 3]).seconds.tolist() == [0.0, 3600.0]


def record(names, encoding=None):
    """A bearing and a motor that warm, then as many other columns as there are names, the last of them the room."""
    columns = [20.0 + 9.0 * -np.expm1(-MINUTES / 40.0), 20.0 + 7.0 * -np.expm1(-MINUTES / 40.0)]
    columns += [30.0 + (k + 1) * np.sin(MINUTES / 9.0) ** 2 for k in range(len(names) - 4)] + [20.0 + 0.01 * (MINUTES % 7)]
    rows = [",".join(names)] + [",".join([f"{m:g}", *(f"{c[i]:.2f}" for c in columns)]) for i, m in enumerate(MINUTES)]
    return ("\n".join(rows) + "\n").encode(encoding or "utf-8")


@pytest.mark.parametrize(
    ("encodings", "names"),
    [
        (("utf-8", "euc_kr"), "시간 (분),앞베어링 온도,모터 온도,습도,전력,유량,실온"),
        (("utf-8", "cp1251", "koi8_r", "cp866"), "Время (мин),Передний подшипник,Двигатель,Влажность,Ток,Давление,Воздух"),
        (("utf-8", "cp1254"), "Süre (dk),Ön yatak sıcaklığı,Motor sıcaklığı,Nem,Akım,Basınç,Ortam"),
        (("utf-8", "big5"), "時間 (分),前軸承溫度,馬達溫度,濕度,電流,壓力,室溫"),
        (("utf-8", "euc_jp", "cp932"), "時刻 (分),前軸受温度,モータ温度,湿度,電流,油圧,室温"),
        (("utf-8", "gb18030"), "时刻 (分),前轴承温度,电机温度,湿度,电流,油压,室温"),
        (
            ("utf-8", "cp1253", "iso8859_7"),
            "Χρόνος (λεπτά),Θερμοκρασία 1,Θερμοκρασία 2,Υγρασία,Ισχύς,Πίεση,Θερμοκρασία περιβάλλοντος",
        ),
    ],
)
def test_quantities_and_rooms_in_other_alphabets(encodings, names, tmp_path):
    names = names.split(",")
    for encoding in encodings:
        (tmp_path / "run.csv").write_bytes(record(names, encoding))
        run = tf.read(tmp_path / "run.csv", strict=True)
        assert list(run.channels) == names[1:3], encoding
        assert list(run.inputs) == names[3:6], encoding
        assert list(run.ambient) == names[6:], encoding
        assert run.time_s[-1] == 7200.0


def test_letters_of_an_unknown_alphabet_are_a_guess(tmp_path):
    """Hebrew as Windows-1252: nobody can say what the columns are called."""
    (tmp_path / "run.csv").write_bytes(record(["Time (min)", "מיסב קדמי", "מנוע", "חדר"], "cp1255"))
    run = tf.read(tmp_path / "run.csv")
    assert any("letters of an unknown alphabet" in guess.text for guess in run.guesses)
    with pytest.raises(tf.InputError, match="encoding says which"):
        tf.read(tmp_path / "run.csv", strict=True)
    (tmp_path / "run.csv").write_bytes(record(["Zeit (min)", "Gehäuse Öl", "Kühlöl", "Raum"], "cp1252"))
    assert tf.read(tmp_path / "run.csv", strict=True).guesses == ()
